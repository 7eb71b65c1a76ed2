"""An entry: what it takes to make one, what is checked of its files, and the site of several."""

import json
import platform
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexaxis.experiments.board import ranking, submission, verification
from flexaxis.experiments.board.entry import (
    ENTRY,
    ROWS,
    EntryError,
    about_from,
    checked,
    read,
    seal,
)
from flexaxis.experiments.board.ranking import (
    Own,
    board,
    check_rows,
    own_of,
    reference_rows,
    standings,
)
from flexaxis.experiments.board.site import (
    Shown,
    Taken,
    collect,
    command,
    in_order,
    newest,
    write_site,
)
from flexaxis.experiments.board.submission import bring, submit
from flexaxis.experiments.board.verification import Ask, of_form, verify_entry
from flexaxis.experiments.building.code import CodeRefused
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.comparison.mismatch import TRACKS, track_of
from flexaxis.experiments.studies.sweep import reference

sys.path.insert(0, str(Path(__file__).parent))
from boards import ABOUT, HONEST, MEANS, SMALL, WIDE, about, entered

HASH = "e513a0234f91abaa"
NASTY = "<script>alert(1)</script> & <img src=http://x.example/y>"


@pytest.fixture(scope="module")
def entry(tmp_path_factory):
    """An entry of a file's class, made once."""
    home = tmp_path_factory.mktemp("entrant")
    (home / "mine.py").write_text("from helper import Honest\n")
    (home / "helper.py").write_text(HONEST)
    return entered(home / "entry", home / "mine.py:Honest", description=NASTY)


@pytest.fixture
def copy(entry, tmp_path):
    return shutil.copytree(entry.folder, tmp_path / "copy")


def changed(folder, change):
    """Change entry.json and close it again, as a forger would."""
    content = json.loads((folder / ENTRY).read_text())
    change(content)
    for key in ("form", "files", "digest"):
        content.pop(key)
    seal(folder, content)


def test_the_suite_is_frozen():
    """What is changed here is another board: give it another name."""
    assert board().hash.startswith(HASH)
    assert board().seeds == tuple(range(1000, 1024))
    assert {track_of(s) for s in board().scenarios} == {*TRACKS}


def test_all_that_is_missing_is_told_at_once(tmp_path):
    file = tmp_path / "entry.toml"
    file.write_text('name = "no good"\nlicense = "MIT"\ntuned_on = "0:100, 1000:1008"\n')
    with pytest.raises(EntryError) as caught:
        about_from(file, {"version": "1"}, {})
    text = "\n".join(caught.value.problems)
    for part in ("license: unknown. Did you mean 'licence'?", "name: 'no good'", "licence: missing",
                 "contact: missing", "description: missing", "kept for reporting"):  # fmt: skip
        assert part in text
    assert "version" not in text


@pytest.mark.parametrize("seeds", ["none", "0:100", "0:50,5000:6000"])
def test_seeds_that_may_be_tuned_on(seeds):
    assert checked(ABOUT | {"tuned_on": seeds}).tuned_on == seeds


def test_an_entry_holds_its_code_and_its_own_rows(entry):
    assert entry.estimator == "code/mine.py:Honest"
    assert [path.name for path in entry.code] == ["helper.py", "mine.py"]
    assert {p.name for p in entry.folder.iterdir()} == {ENTRY, ROWS, "code"}
    rows = entry.rows()
    assert {row["seed"] for row in rows} == {*SMALL.seeds}
    assert {row["estimator"] for row in rows} == {"code/mine.py:Honest"}


def test_the_computer_is_named_to_nobody(entry):
    text = (entry.folder / ROWS).read_text() + (entry.folder / ENTRY).read_text()
    for name in (platform.node(), str(entry.folder.parent)):
        assert name not in text.replace(entry.command, "")


def test_settings_follow_from_the_turns_of_the_knob(entry):
    knob = {"1.0": {"forgetting": 0.99}, "4.0": {"forgetting": 0.96}}
    mine = replace(entry, knob=knob, turns={"fm_step-v1": [1.0, 4.0]})
    settings = mine.settings(SMALL.scenarios[0])
    assert settings == {
        "code/mine.py:Honest[forgetting=0.99]": 1.0, "code/mine.py:Honest[forgetting=0.96]": 4.0
    }  # fmt: skip
    assert mine.settings(find_scenario("kt_step-v1")) == {}


def test_code_of_programs_comes_along_and_nothing_from_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.m").write_text("x")
    text = bring("pipe:octave-cli -q my.m /etc/passwd ../my.m", tmp_path / "entry")
    assert text == "pipe:octave-cli -q code/my.m /etc/passwd ../my.m"
    assert [path.name for path in (tmp_path / "entry").rglob("*.*")] == ["my.m"]
    assert bring("glr[walk=2]", tmp_path / "other") == "glr[walk=2]"


def test_what_is_there_is_not_written_over(entry):
    with pytest.raises(EntryError, match="holds a finished entry"):
        entered(entry.folder, "rpem-forgetting")


FRICTION = """
class Friction:
    names, output, knob = ("f_m",), "speed", {1: {"gain": 0.01}, 2: {"gain": 0.02}}

    def __init__(self, nominal, period, *, gain=0.01):
        self.gain, self.found = gain, nominal["f_m"]

    def step(self, u, y):
        self.found *= 1 + 0.001 * self.gain * (-1) ** (y is None or y > 0)
        return [self.found]
"""
"""An estimator with a knob that does not know k_T."""


def test_a_fault_of_which_nothing_is_estimated_is_left_out(tmp_path):
    (tmp_path / "mine.py").write_text(FRICTION)
    said = []
    entry = submit(f"{tmp_path}/mine.py:Friction", tmp_path / "entry", about(), WIDE, MEANS,
                   say=said.append)  # fmt: skip
    why = "code/mine.py:Friction estimates f_m, of which nothing changes in kt_step-v1"
    assert entry.left_out == {"kt_step-v1": why}
    assert said == [f"kt_step-v1 is left out, and counts as doing nothing: {why}"]
    assert entry.turns == {"load-v1": [1.0], "fm_step-v1": [1.0, 2.0]}
    _, verdict = of_form(entry.folder, WIDE)
    assert verdict.holds
    own = own_of(entry, WIDE, reference_rows(WIDE, MEANS))
    (there,) = own.at_excess
    assert there["scenario"] == "fm_step-v1"
    both = [there | {"estimator": "both 1", "scenario": s.name} for s in WIDE.faults]
    places = standings({entry.label: own, "both 1": replace(own, at_excess=both)}, WIDE)
    value = {place["label"]: place["value"] for place in places["nominal"]["places"]}
    assert value[entry.label] == pytest.approx(value["both 1"] / 2)


def test_what_was_run_stays_until_its_entry_is_right(tmp_path, monkeypatch):
    """Else the line with `--resume` had nothing to go on with, and met a finished entry."""
    monkeypatch.setattr(submission, "environment", lambda: {"cores": 2})
    with pytest.raises(EntryError, match=r"environment\.cores"):
        entered(tmp_path / "entry", "rpem-forgetting")
    assert not (tmp_path / "entry" / ENTRY).exists()
    monkeypatch.undo()
    heard: list[object] = []
    means = replace(MEANS, advance=heard.append)
    entry = submit("rpem-forgetting", tmp_path / "entry", about(), SMALL, means, resume=True)
    assert of_form(entry.folder, SMALL)[1].holds and not heard


@pytest.mark.parametrize("given", [{}, {"install": ""}])
def test_who_needs_nothing_says_nothing(given):
    table = {key: text for key, text in ABOUT.items() if key != "install"}
    assert checked(table | given).install == "nothing besides flexaxis"


@pytest.mark.parametrize("control", ["oracle-reset", "frozen"])
def test_controls_enter_no_board(control, tmp_path):
    with pytest.raises(EntryError, match="is a control"):
        entered(tmp_path / "entry", control)


def test_a_whole_entry_holds(entry):
    found, verdict = of_form(entry.folder, SMALL)
    assert verdict.holds and not verdict.ran and len(verdict.checks) == 3
    assert found.digest == entry.digest


@pytest.mark.parametrize("name", [ROWS, "code/helper.py"])
def test_a_change_of_any_file_is_found(copy, name):
    (copy / name).write_bytes((copy / name).read_bytes().replace(b"1", b"2", 1))
    with pytest.raises(EntryError, match=rf"{name}: .*not as it was written"):
        read(copy)


def test_what_does_not_belong_is_found(copy):
    (copy / "more.sh").write_text("echo")
    with pytest.raises(EntryError, match=r"'more\.sh' is in the folder, but not among the files"):
        read(copy)
    (copy / "more.sh").unlink()
    (copy / "code" / "__pycache__").mkdir()  # Python would run it in the place of what is shown
    (copy / "code" / "__pycache__" / "mine.cpython-311.pyc").write_text("other code")
    with pytest.raises(EntryError, match=r"mine\.cpython-311\.pyc' is in the folder"):
        read(copy)
    shutil.rmtree(copy / "code" / "__pycache__")
    (copy / ROWS).unlink()
    (copy / ROWS).symlink_to("/etc/hostname")
    with pytest.raises(EntryError, match="is a link"):
        read(copy)


def test_a_folder_that_is_a_link_is_none_of_an_entry(copy, tmp_path):
    name = next(n for n in json.loads((copy / ENTRY).read_text())["files"] if "/" in n)
    folder = copy / Path(name).parts[0]
    folder.rename(tmp_path / "elsewhere")
    folder.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(EntryError, match=rf"{name}: is a link"):
        read(copy)


def test_a_name_that_leaves_the_folder_is_refused(copy):
    content = json.loads((copy / ENTRY).read_text())
    content["files"]["../../secret"] = "0" * 64
    (copy / ENTRY).write_text(json.dumps(content))
    with pytest.raises(EntryError, match="is no name of a file in an entry"):
        read(copy)


@pytest.mark.parametrize(
    ("key", "value"),
    [("about", {"name": "../x"}), ("turns", {"fm_step-v1": [1.0, 3.0]}), ("quick", "no"),
     ("turns", {"fm_step-v1": [2.0]}), ("turns", {"fm_step-v1": [1.0, 1.0]}), ("suite", 1),
     ("knob", {"1.0": {"a=1,b": 1.0}}), ("knob", {"2.0": {"gain": 1.0}}), ("left_out", {"a": 1}),
     ("extra", 1)],
)  # fmt: skip
def test_what_is_of_the_wrong_form_is_told(copy, key, value):
    changed(copy, lambda content: content.update({key: value}))
    with pytest.raises(EntryError):
        read(copy)


def with_rows(folder, change):
    """What is said of an entry's rows when they are changed, and the entry closed again."""
    rows = [json.loads(line) for line in (folder / ROWS).read_text().splitlines()]
    (folder / ROWS).write_text("".join(json.dumps(row) + "\n" for row in change(rows)))
    changed(folder, lambda content: None)
    _, verdict = of_form(folder, SMALL)
    return next((c.seen for c in verdict.checks if c.holds is False), "")


@pytest.mark.parametrize(
    ("change", "said"),
    [(lambda rows: rows[3:], "no rows of 1 of 5 seeds"),
     (lambda rows: rows + rows[:3], "rows of a run twice"),
     (lambda rows: rows[1:], "rows of a run twice, or not all"),
     (lambda rows: [*rows, rows[0] | {"seed": 9000}], "seed 9000 is none of the suite"),
     (lambda rows: [*rows, rows[0] | {"estimator": "ekf"}], "no setting of the estimator"),
     (lambda rows: [*rows, rows[0] | {"estimator": reference()}], "no setting of the estimator"),
     (lambda rows: [*rows, rows[0] | {"hash": "0" * 64}], "no setting of the estimator"),
     (lambda rows: [row | {"error": "x"} for row in rows], "a run has failed"),
     (lambda rows: [{"a": 1}], "are not what rows are"),
     (lambda rows: [3], "lines that are no rows"), (lambda rows: rows, "")],
)  # fmt: skip
def test_rows_are_those_of_the_suite_each_once(copy, change, said):
    found = with_rows(copy, change)
    assert said in found and bool(said) == bool(found)


def test_nobody_chooses_other_turns_for_a_scenario(entry):
    """Between which two settings equal noise is found would be up to the entrant."""
    wide = replace(SMALL, scenarios=(*SMALL.scenarios, find_scenario("kt_step-v1")))
    knob = {str(turn): {"forgetting": 1 - 0.01 * turn} for turn in (1.0, 2.0)}
    mine = replace(entry, knob=knob, turns={"fm_step-v1": [1.0, 2.0], "kt_step-v1": [1.0]})
    assert check_rows(mine, wide) == "kt_step-v1: lacks turns that other scenarios have"


def test_what_was_neither_run_nor_left_out_is_found(entry):
    wide = replace(SMALL, scenarios=(*SMALL.scenarios, find_scenario("kt_step-v1")))
    mine = replace(entry, suite=wide.hash)
    assert check_rows(mine, wide) == "neither run nor left out: kt_step-v1"


def test_the_reference_is_run_by_whoever_asks(entry, monkeypatch):
    """Whoever enters it has its rows from us: else he would move all that it is compared with."""
    usual = reference_rows(SMALL, MEANS)
    assert {row["estimator"] for row in usual} == {reference()} and len(usual) == 15
    mine = replace(entry, estimator="rpem-forgetting", knob={"1.0": {"forgetting": 0.995}})
    (found,) = own_of(mine, SMALL, usual).at_excess
    assert found["ratio"] == 1.0 and found["how"] == "matched"
    forged = [row | {"lag": row["lag"] and row["lag"] / 2} for row in usual]
    monkeypatch.setattr(type(mine), "rows", lambda self: forged)
    assert own_of(mine, SMALL, usual).at_excess[0]["lag"] == found["lag"]


def test_another_suite_is_found(entry):
    other = replace(SMALL, seeds=SMALL.seeds[1:])
    _, verdict = of_form(entry.folder, other)
    assert [c.name for c in verdict.checks if c.holds is False] == ["on the frozen suite"]


@pytest.fixture(scope="module")
def mine(entry):
    return own_of(entry, SMALL, reference_rows(SMALL, MEANS))


def taken(entry, label, own, digest="0" * 64):
    name, _, version = label.partition(" ")
    mine = replace(entry, about=replace(entry.about, name=name, version=version), digest=digest)
    return Taken(mine, own)


def test_code_is_not_run_unasked(entry):
    with pytest.raises(CodeRefused, match=r"code/mine\.py:Honest"):
        verify_entry(entry.folder, Ask(), frozen=SMALL)


def test_versions_are_in_order(entry, mine):
    order = ["0.2", "1.9.dev1", "1.9a2", "1.9-rc1", "1.9", "1.9.post1", "1.10", "v2"]
    every = [taken(entry, f"a {v}", mine) for v in reversed(order)]
    assert [each.entry.about.version for each in in_order(every)] == order
    assert [each.entry.about.version for each in newest(every)] == ["v2"]


@pytest.mark.parametrize(
    ("key", "value"), [("version", "1²"), ("name", "mу-tracker"), ("tuned_on", "²:³")]
)
def test_names_and_versions_are_of_ascii(key, value):
    """A look-alike is another name for Python and the same for the eye."""
    with pytest.raises(EntryError, match=f"{key}: .* is not what is asked"):
        checked(ABOUT | {key: value})


def test_a_name_belongs_to_a_contact(entry, copy):
    changed(copy, lambda c: c["about"].update(version="999", name="MINE", contact="x@y.example"))
    (one,), left = collect([entry.folder, copy], SMALL, {}, means=MEANS)
    assert one.entry.label == entry.label
    assert "the name MINE is that of me@example.org" in left[str(copy)][0]


def test_pages_of_like_names_are_apart_and_who_leads_unverified_is_said(entry, mine, tmp_path):
    mine = replace(mine, at_excess=[each | {"how": "matched"} for each in mine.at_excess])
    every = [taken(entry, "my-tracker 2", mine, "1" * 64),
             taken(entry, "my tracker-2", mine, "2" * 64)]  # fmt: skip
    found = write_site(Shown(every, {}, SMALL, False, "flexaxis board …"), tmp_path)
    assert len({each["page"] for each in found["entries"]}) == 2
    page = (tmp_path / "index.html").read_text()
    first = page.partition("Who is ahead")[2].partition("</dl>")[0]
    assert "my-tracker 2 (unverified)" in first and "☆" in page and "★ <" not in page
    _, verdict = of_form(entry.folder, SMALL)
    verdict.token, verdict.confined, verdict.sample, verdict.hidden = "0" * 16, True, 10, 8
    every = [replace(each, verdict=verdict.as_json()) for each in every]
    write_site(Shown(every, {}, SMALL, False, "flexaxis board …"), tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert "unverified)" not in page.partition("</dl>")[0]


def test_the_site_shows_text_as_text_and_asks_for_nothing(entry, mine, tmp_path):
    every = [taken(entry, label, mine) for label in ("a 1", "a 2", "b 1")]
    left = {"bad": (f"bad: {NASTY}",)}
    found = write_site(Shown(every, left, SMALL, False, "flexaxis board …"), tmp_path)
    pages = [
        p.read_text() for p in (tmp_path / "index.html", tmp_path / "entries" / "a-1-00000000.html")
    ]
    for page in pages:
        assert "&lt;script&gt;alert(1)" in page and "<script>alert" not in page
        assert not re.search(r"<\w[^<>]*\s(?:src|href)=.?https?:", page)
    assert found["tracks"]["nominal"]["places"][0]["label"] in {"a 2", "b 1"}
    assert "unverified" in pages[0]
    assert "flexaxis tradeoff fm_step-v1 --estimator code/mine.py:Honest" in pages[1]
    assert len(found["entries"]) == 3 and json.loads((tmp_path / "board.json").read_text())


def test_a_line_to_type_is_quoted():
    line = command(SMALL, "x.py:X; rm -rf ~", "fm_step-v1")
    assert line == "flexaxis run fm_step-v1 --estimator 'x.py:X; rm -rf ~' --seeds 1000:1005"


def test_verdicts_count_by_digest_alone(entry, copy):
    digest = entry.digest
    whole = {"ran": True, "holds": True, "accepted": True, "checks": [], "sample": 10, "hidden": 8}
    good = {digest: whole}
    bad = {digest: {"ran": True, "holds": False, "checks": [
        {"name": "unknown seeds", "holds": False, "seen": "9 ×"}]}}  # fmt: skip
    (found,), _ = collect([copy], SMALL, good, means=MEANS)
    assert found.state == "verified"
    for less, state in (
        ({"accepted": False}, "unverified"),  # as of what ran unconfined
        ({"ran": False}, "unverified"),
        ({"hidden": 2}, "verified in part"),
        ({"sample": 1}, "verified in part"),
    ):
        (found,), _ = collect([copy], SMALL, {digest: whole | less}, means=MEANS)
        assert found.state == state
    (found,), _ = collect([copy], SMALL, {"other": good[digest]}, means=MEANS)
    assert found.state == "unverified"
    none, left = collect([copy, copy], SMALL, bad)
    assert not none and "rejected: unknown seeds: 9 ×" in left[str(copy)][0]


def test_entries_for_trying_are_kept_apart(copy):
    none, left = collect([copy], SMALL, {}, quick=True)
    assert not none and "full entry" in left[str(copy)][0]


def row(label, scenario, score, how="matched", bound=0.1):
    rng = np.random.default_rng(len(label))
    return {
        "scenario": scenario, "parameter": "f_m", "estimator": label, "how": how, "bound": bound,
        "lag": 1.0, "over_bound": 10.0, "false_alarms_per_1000_s": None,
        "values": {"score": (score + rng.normal(size=8)).tolist(),
                   "lag": (-score / 50 + 0.01 * rng.normal(size=8)).tolist()},
    }  # fmt: skip


def test_who_is_ahead_on_each_track():
    names = ("fm_step-v1", "power_fm_step-v1", "load-v1", "directional_fm_step-v1")
    small = replace(SMALL, scenarios=tuple(map(find_scenario, names)), seeds=tuple(range(8)))
    entries = {
        label: Own(
            [
                row(label, names[0], score),
                *(row(label, name, score, bound=None) for name in names[1::2]),
            ],
            [{"scenario": names[2], "excess": 1.0, "false_alarms_per_1000_s": None, "lost": 0,
              "values": {"excess": [-score] * 8}, "parameter": None, "how": "matched"}],
            0, 24,
        )
        for label, score in (("good 1", 90.0), ("same 1", 90.0), ("slow 1", 40.0))
    }  # fmt: skip
    entries["none 1"] = Own([], [], 0, 0)
    # fast where it runs: where it does not, it counts as doing nothing
    entries["half 1"] = Own([row("half 1", names[1], 150.0, bound=None)], [], 0, 0)
    found = standings(entries, small)
    for track in ("nominal", "unknown structure", "nuisance"):
        places = found[track]["places"]
        assert {p["label"] for p in places if p["leads"]} == {"good 1", "same 1"}, track
        rest = ["slow 1", *(["half 1", "none 1"] if track[0] == "u" else ["none 1", "half 1"])]
        assert [p["label"] for p in places][2:] == rest, track
    assert found["nominal"]["places"][0]["over_bound"] == pytest.approx(10)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["submit", "glr", "-o", "x", "--contact", "me"], "licence: missing"),
        (["submit", "moving-horizn", "-o", "x"], "Did you mean 'moving-horizon'"),
        (["board", "nowhere", "-o", "x"], "nowhere"),
        (
            ["board", "nowhere", "-o", "x", "--verdicts", "nothing"],
            "nothing: there is no such folder",
        ),
        (["verify", "nowhere", "--form"], "is no entry"),
        (["verify", "run"], "`flexaxis rerun run` runs some of its cases again"),
    ],
)
def test_mistakes_are_said_in_a_line(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "study.json").write_text("{}")
    assert main(words) == 2
    err = capsys.readouterr().err
    assert said in err and "Traceback" not in err


def test_an_entry_of_good_form_is_no_finding(copy, capsys, monkeypatch):
    monkeypatch.setattr(verification, "of_form", lambda folder: of_form(folder, SMALL))
    assert main(["verify", str(copy), "--form"]) == 0
    assert "REJECTED" not in capsys.readouterr().out


def test_a_changed_entry_is_a_finding(copy, capsys):
    (copy / ROWS).write_text("{}")
    assert main(["verify", str(copy), "--form"]) == 1
    assert "REJECTED" in capsys.readouterr().out
    assert main(["verify", str(copy), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["holds"] is False and ROWS in found["problems"][0]


def test_the_interval_of_a_lag_begins_at_its_lower_end():
    """A score is the larger the smaller the lag."""
    found = {"score_interval": [1.0, 2.0], "score": 1.5, "estimator": "e", "how": "matched",
             "faults": 1, "leads": True}  # fmt: skip
    for measure in ("lag", "score"):
        place = ranking._place(found, [], measure)
        low, high = place["interval"]
        assert low < place["value"] < high
