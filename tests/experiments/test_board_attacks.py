"""Who cheats on a board is rejected, whatever is drawn; who is honest is accepted."""

import json
import shutil
import sys
from pathlib import Path

import pytest

from flexaxis.experiments.board.entry import ENTRY, ROWS, read, seal
from flexaxis.experiments.board.hidden_seeds import Draw
from flexaxis.experiments.board.verification import UNKNOWN, Ask, of_form, verify_entry
from flexaxis.experiments.storage.files import dumps
from flexaxis.experiments.studies.sweep import reference

sys.path.insert(0, str(Path(__file__).parent))
from boards import CHEATS, HONEST, MEANS, SMALL, TOKENS, confined, entered, known

REPORTED = "reported rows"
ESTIMATORS = {
    "honest": "honest:Honest",
    "memoriser": "memory:Memory",
    "memoriser behind its knob": "memory_knob:Turned",
    "peeker": "peeker:Peeker",
    "teller": "teller:Teller",
    "leak": "leak:Leak",
    "look-ahead": "ahead:Ahead",
}
SECRET = "index-url = https://user:password@index.example.org"


def forged(folder, change):
    """Change the rows of an entry, and close it again, as a forger would."""
    rows = change([json.loads(line) for line in (folder / ROWS).read_text().splitlines()])
    (folder / ROWS).write_text("".join(dumps(row) + "\n" for row in rows))
    content = json.loads((folder / ENTRY).read_text())
    seal(folder, {k: v for k, v in content.items() if k not in {"form", "files", "digest"}})
    return folder


@pytest.fixture(scope="module")
def entry(tmp_path_factory):
    """A function that gives the entry of an estimator, made once."""
    made = {}

    def give(name):
        if name not in made:
            home = tmp_path_factory.mktemp("entrant")
            for path in CHEATS.glob("*.py"):
                text = path.read_text().replace("HOME_OF_ENTRANT", str(home))
                (home / path.name).write_text(text.replace("FOLDER", f"left-{home.name}"))
            (home / "honest.py").write_text(HONEST)
            known(home, SMALL)
            module, _, text = ESTIMATORS[name].partition(":")
            made[name] = entered(home / "entry", home / f"{module}.py:{text}").folder
            shutil.rmtree(home / "code", ignore_errors=True)
            (home / "away").mkdir()
            made[name] = Path(shutil.move(made[name], home.with_name(f"{home.name}-entry")))
            shutil.rmtree(home)
        return made[name]

    return give


def judged(folder, token, **ask):
    asked = Ask(**{"sample": 4, "hidden": 6, "draw": Draw.new(token)} | ask)
    return verify_entry(folder, asked, run_code=True, means=MEANS, frozen=SMALL)


def wrong(verdict):
    return {check.name for check in verdict.checks if check.holds is False}


@pytest.mark.slow
@confined
@pytest.mark.parametrize("token", TOKENS)
def test_an_honest_entry_is_accepted(entry, token):
    found = judged(entry("honest"), token)
    assert found.accepted and found.ran, [c for c in found.checks if c.holds is False]


@pytest.mark.slow
@confined
@pytest.mark.parametrize("token", TOKENS)
@pytest.mark.parametrize(
    ("name", "at_least"),
    [("memoriser", {UNKNOWN}), ("memoriser behind its knob", {UNKNOWN}),
     ("teller", {REPORTED, UNKNOWN}), ("look-ahead", {REPORTED}), ("leak", {REPORTED, UNKNOWN})],
)  # fmt: skip
def test_a_cheat_is_rejected(entry, name, at_least, token):
    found = judged(entry(name), token)
    assert not found.accepted and not found.holds and at_least <= wrong(found)


@pytest.mark.slow
def test_who_looks_into_memory_finds_no_record(entry, tmp_path):
    """Code of an entrant has a process of its own: he is as fast as one that does not look."""
    text = (CHEATS / "peeker.py").read_text()
    (tmp_path / "blind.py").write_text(text.replace("gc.get_objects()", "()"))
    plain = entered(tmp_path / "entry", tmp_path / "blind.py:Peeker")
    lags = [
        [json.loads(line)["lag"] for line in (folder / ROWS).read_text().splitlines()]
        for folder in (entry("peeker"), plain.folder)
    ]
    assert lags[0] == lags[1] and any(lags[0])


@pytest.mark.slow
@confined
@pytest.mark.parametrize("token", TOKENS)
def test_who_makes_his_lags_shorter_is_rejected(entry, tmp_path, token):
    folder = shutil.copytree(entry("honest"), tmp_path / "forged")
    forged(folder, lambda rows: [row | {"lag": row["lag"] and row["lag"] / 3} for row in rows])
    assert {REPORTED, UNKNOWN} <= wrong(judged(folder, token))


def test_rows_of_the_reference_have_no_place_in_an_entry(entry, tmp_path):
    """One of them × 40 would make everybody who is as noisy look quiet."""
    folder = shutil.copytree(entry("honest"), tmp_path / "forged")

    def change(rows):
        return [*rows, *(row | {"estimator": reference(), "excess": 40.0} for row in rows[:3])]

    _, found = of_form(forged(folder, change), SMALL)
    assert wrong(found) == {"rows of this suite"} and not found.holds


@pytest.mark.slow
@confined
def test_a_secret_of_the_keeper_is_in_no_verdict(entry):
    path = Path(sys.prefix) / "pip.conf"
    mine = not path.exists()
    if mine:
        path.write_text(SECRET)
    try:
        found = json.dumps(judged(entry("leak"), TOKENS[0], sample=1, hidden=2).as_json())
    finally:
        if mine:
            path.unlink()
    assert "nothing is here to be read" in found and "password" not in found
    assert "!" * 300 not in found  # nor is there room for more


def test_unconfined_code_is_never_accepted(entry):
    found = judged(entry("honest"), TOKENS[0], sample=1, hidden=2, confined=False)
    assert found.ran and found.holds and not found.accepted
    assert read(entry("honest")).digest == found.digest
