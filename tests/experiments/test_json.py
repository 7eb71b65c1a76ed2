"""`--json`: one object on stdout, alike for every command, with the keys of docs/json.md."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from flexaxis.experiments.cli import main, parser
from flexaxis.experiments.commands.answers import plain

TABLE = Path(__file__).parents[2] / "docs" / "json.md"
HEAD = ["flexaxis", "command", "status", "line"]
STUDY = (
    "scenario='short.toml'\nestimators=['frozen']\nseeds=2\n[sweep]\n'fault[0].factor'=[1.2,2]\n"
)
RUN = "run short.toml --estimator frozen --seeds 2 --jobs 1 -o"

# What is typed, in this order, and how it is called in the documentation; those that take seconds
# are apart.
LINES = [
    ("list", "list"),
    ("show short.toml", None),
    ("show smoke", "show SUITE"),
    ("show ekf", "show ESTIMATOR"),
    ("simulate short.toml -o rec.nc", "simulate"),
    ("simulate short.toml --as-log csv -o log.csv", "simulate --as-log"),
    ("estimate rec.nc --estimator frozen", "estimate"),
    (f"{RUN} one --shard 1/2", "run --shard"),
    (f"{RUN} two --shard 2/2", "run --shard"),
    ("run --from one two -o r", "run --from"),
    ("report r", "report of a run"),
    ("rerun r --sample 1", "rerun"),
    ("study study.toml --dry-run", "study --dry-run"),
    ("compare r r --base frozen --candidate frozen -o c", "compare"),
    ("check frozen", "check"),
    ("new mine.py", "new"),
]
SLOW = [
    (f"{RUN} r", "run"),
    ("study study.toml --jobs 1 -o st", "study"),
    ("report st", "report of a study"),
    ("compare short.toml --base frozen --candidate frozen --seeds 4 --jobs 1 -o d", "compare"),
    ("tune ekf --seeds 0:1 --jobs 1 -o tu", "tune"),
    ("tune ekf --seeds 2 --jobs 1 -o tr --sweep short.toml", "tune --sweep"),
]


@pytest.fixture
def place(short_toml, monkeypatch):
    monkeypatch.chdir(short_toml.parent)
    Path("study.toml").write_text(STUDY)


def answered(capsys, line):
    """Return status and object of a command; nothing else is on stdout."""
    try:
        status = main([*line.split(), "--json"])
    except SystemExit as stop:
        status = stop.code
    out = capsys.readouterr().out
    assert out.endswith("}\n") and out.count("\n") == 1, line
    found = json.loads(out, parse_constant=lambda name: pytest.fail(f"{line}: {name}"))
    assert list(found)[:4] == HEAD and found["status"] == status
    return found


def documented(label):
    """Return the keys that docs/json.md has for a command."""
    rows = [line.split("|")[1:3] for line in TABLE.read_text().splitlines() if line[:3] == "| `"]
    (keys,) = [keys for name, keys in rows if label in name.replace("`", "").strip().split(", ")]
    more = documented("run") if keys.startswith(" as `run`") else set()
    return (
        set(re.findall(r"`(\w+)`", keys.partition(": of each")[0].removeprefix(" as `run`"))) | more
    )


@pytest.mark.parametrize("lines", [LINES, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_commands_answer_alike_with_the_keys_of_the_documentation(capsys, place, lines):
    for line, label in lines:
        found = answered(capsys, line)
        assert found["command"] == line.split()[0] and found["status"] == 0, found
        assert found["line"].startswith(f"flexaxis {line.split()[0]} "), found["line"]
        if label is None:
            assert found["name"] == "short" and found["fault"][0]["factor"] == 1.5
            continue
        keys, known = set(found) - set(HEAD), documented(label)
        assert keys == known, (line, keys ^ known)


@pytest.mark.parametrize(
    ("line", "command", "status", "error"),
    [
        ("run fm_stp-v1", "run", 2, "Did you mean 'fm_step-v1'?"),
        ("rnu", None, 2, "Did you mean 'run'?"),
        ("list --grup steps", "list", 2, "Did you mean '--group'?"),
        ("estimate no.nc", "estimate", 2, "no such file"),
        ("check own.py:Mine", "check", 70, "ZeroDivisionError"),
    ],
)
def test_what_goes_wrong_is_an_answer_as_well(  # noqa: PLR0917
    capsys, place, line, command, status, error
):
    Path("own.py").write_text("class Mine:\n    def __init__(self, nominal, period): 1 / 0\n")
    found = answered(capsys, line)
    assert found["command"] == command and found["status"] == status
    assert error in found["error"] and list(found) == [*HEAD, "error"]


def test_every_command_has_it_and_is_documented():
    """But the one that serves a page."""
    text = TABLE.read_text()
    found = next(action for action in parser()._actions if action.dest == "command")
    for name, sub in found.choices.items():
        has = "--json" in sub._option_string_actions
        assert has or name == "demo", name
        assert not has or re.search(rf"^\| .*`{name}\b", text, re.MULTILINE), name


def test_what_json_has_no_word_for():
    content = {"a": np.float64("nan"), "b": np.arange(2), "c": (float("inf"), Path("x/y")), 1: True}
    assert plain(content) == {"a": None, "b": [0, 1], "c": [None, "x/y"], "1": True}
    assert plain({"d": {"e": np.int64(3)}}) == {"d": {"e": 3}}
