"""TOML and JSON files are read, or refused in one line that names the file."""

import pytest

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.files import json_value, read_toml, shown, toml_tables


@pytest.mark.parametrize("text", ["a = 1\na = 2", "a = 2021-02-30", "a = " + "1" * 5000])
def test_invalid_toml_names_the_source(text):
    with pytest.raises(ScenarioError, match=r"^mine\.toml: not valid TOML: "):
        toml_tables(text, source="mine.toml", refuse=ScenarioError)


def test_json():
    assert json_value(b'{"a": [1, null]}', source="it", refuse=ValueError) == {"a": [1, None]}
    with pytest.raises(ScenarioError, match=r"^rows: not valid JSON"):
        json_value("[" * 100_000, source="rows", refuse=ScenarioError)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ScenarioError, match=r"none.toml: cannot be read: No such file"):
        read_toml(tmp_path / "none.toml", ScenarioError)
    (tmp_path / "latin.toml").write_bytes(b"a = '\xe9'")
    with pytest.raises(ScenarioError, match=r"latin.toml: not UTF-8 text, from byte 5 on"):
        read_toml(tmp_path / "latin.toml", ScenarioError)


def test_values_are_shown_short():
    assert len(shown("x" * 10**6)) < 100
    assert len(shown([[[["y" * 1000]]]] * 1000)) < 200


def test_a_byte_order_mark_is_skipped(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b'\xef\xbb\xbfname = "mine"\r\n')
    assert read_toml(path, ScenarioError) == {"name": "mine"}
