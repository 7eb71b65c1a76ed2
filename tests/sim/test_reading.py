"""Tables of unknown origin are read within limits, or refused in one line."""

import os

import pytest

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.storage.reading import (
    LARGEST,
    json_value,
    read_text,
    read_toml,
    shown,
    toml_tables,
)


def toml(text):
    return toml_tables(text, source="mine.toml", refuse=ScenarioError)


def test_what_is_within_is_as_it_stands():
    assert toml('a = 1e99\n[b]\nc = ["x", inf, nan]\n')["b"]["c"][:2] == ["x", float("inf")]
    assert json_value(b'{"a": [1, null]}', source="it", refuse=ValueError) == {"a": [1, None]}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 5000 + "]" * 5000, "nested deeper than 20"),
        ("a = " + "[" * 25 + "]" * 25, r"a(\[0\])+: nested deeper than 20"),
        ("a = " + "1" * 5000, "not valid TOML"),
        ("a = " + "1" * 200, "a: 1+.*1+ is beyond"),
        ("[b]\nc = 1e300", "b.c: 1e[+]300 is beyond"),
        ('a = "' + "x" * 20_001 + '"', "a: a text of 20001 characters"),
        ("x" * 500 + " = 1", "a key of more than 400"),
        ("a = 1 #" + "x" * LARGEST, "larger than"),
        ("a = 1\na = 2", "not valid TOML: Cannot overwrite"),
        ("a = 2021-02-30", "not valid TOML"),
    ],
)
def test_what_is_beyond_is_refused_by_its_key(text, said):
    with pytest.raises(ScenarioError, match=said) as refused:
        toml(text)
    assert str(refused.value).startswith("mine.toml: ")
    assert len(str(refused.value)) < 400


def test_json_of_a_thousand_levels():
    with pytest.raises(ScenarioError, match="rows: not valid JSON: nested deeper"):
        json_value("[" * 100_000, source="rows", refuse=ScenarioError)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ScenarioError, match=r"none.toml: cannot be read: No such file"):
        read_toml(tmp_path / "none.toml", ScenarioError)
    (tmp_path / "latin.toml").write_bytes(b"a = '\xe9'")
    with pytest.raises(ScenarioError, match=r"latin.toml: not UTF-8 text, from byte 5 on"):
        read_toml(tmp_path / "latin.toml", ScenarioError)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no such pipes")
def test_a_pipe_that_nobody_writes_to_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(ScenarioError, match="a pipe, which may wait for ever: write it to a file"):
        read_text(tmp_path / "a.toml", ScenarioError)


def test_values_are_shown_short():
    assert len(shown("x" * 10**6)) < 100
    assert len(shown([[[["y" * 1000]]]] * 1000)) < 200


def test_the_mark_that_some_editors_begin_with(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b'\xef\xbb\xbfname = "mine"\r\n')
    assert read_toml(path, ScenarioError) == {"name": "mine"}
