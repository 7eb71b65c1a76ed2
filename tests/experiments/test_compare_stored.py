"""Finished runs compared as they are, and refused where they cannot be."""

import json

import numpy as np
import pytest

from flexaxis.experiments.files import STUDY, SUMMARY
from flexaxis.experiments.gate.report import write
from flexaxis.experiments.gate.stored import compare_runs
from flexaxis.experiments.gate.wording import headline, meaning
from flexaxis.experiments.scoring.score_table import MARGINS
from flexaxis.sim.errors import FlexaxisError


def rows(scale=1.0, *, seeds=8):
    """Rows of one estimator on one scenario: a lag of about `scale`."""
    noise = np.random.default_rng(0).normal(0, 0.005, seeds)
    return [
        {
            "case": f"e{k}",
            "scenario": "s",
            "hash": "h",
            "estimator": "e",
            "seed": k,
            "parameter": "f_m",
            "lag": scale * np.exp(noise[k]),
            "std": 1.0,
            "diverged": False,
            "never_settled": False,
        }
        for k in range(seeds)
    ]


@pytest.fixture
def kept(tmp_path, stored):
    """A function that stores rows as a run, and gives its folder."""

    def keep(name, made):
        stored(tmp_path / name, made)
        (tmp_path / name / SUMMARY).write_text(json.dumps({"versions": {"flexaxis": "1"}}))
        return tmp_path / name

    return keep


@pytest.fixture
def folders(kept):
    """Two stored runs, the second slower."""
    return kept("old", rows()), kept("new", rows(1.6))


def test_stored_runs(folders, tmp_path):
    found = compare_runs(*folders, MARGINS)
    assert found.verdict == "worse" and found.base == found.candidate == "e"
    page = write(tmp_path / "out", found)
    assert page.is_file() and not list((tmp_path / "out").glob("*.sqlite"))


def test_who_estimates_less_is_named(folders, kept, tmp_path):
    alike = compare_runs(*folders, MARGINS)
    assert "estimates" not in headline(alike) and "nominal" not in meaning(alike)
    both = kept("both", [r | {"parameter": name} for r in rows() for name in ("k_T", "f_m")])
    folders = (both, folders[1])
    found = compare_runs(*folders, MARGINS)
    said = "candidate estimates f_m alone; the base k_T, f_m"
    assert said in headline(found)
    assert "The candidate holds k_T at nominal" in meaning(found)
    page = write(tmp_path / "out", found)
    told = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert said in page.read_text() and said in (tmp_path / "out" / "verdict.md").read_text()
    assert told["estimated"] == {"base": ["k_T", "f_m"], "candidate": ["f_m"]}
    back = compare_runs(*folders[::-1], MARGINS)
    assert "candidate estimates k_T, f_m; the base f_m" in headline(back)
    assert "The base holds k_T" in meaning(back)


def test_stored_runs_on_some_seeds(folders):
    found = compare_runs(*folders, MARGINS, seeds=range(2, 50))
    assert found.seeds == [2, 3, 4, 5, 6, 7] and found.verdicts[0].runs == 6
    with pytest.raises(FlexaxisError, match="have 1 seeds in common of the 43 that --seeds names"):
        compare_runs(*folders, MARGINS, seeds=range(7, 50))


def test_stored_runs_that_cannot_be_compared(folders, kept):
    other = kept("other", [row | {"hash": "g"} for row in rows()])
    with pytest.raises(FlexaxisError, match="different scenarios under the name s"):
        compare_runs(folders[0], other, MARGINS)
    summary = folders[1] / SUMMARY
    summary.write_text(summary.read_text().replace('"1"', '"2"'))
    with pytest.raises(FlexaxisError, match=r"other versions \(flexaxis 1 and 2\)"):
        compare_runs(*folders, MARGINS)
    (rows_of,) = other.glob("*.sqlite")
    rows_of.write_bytes(b"no rows at all" * 1000)
    with pytest.raises(FlexaxisError):
        compare_runs(folders[0], other, MARGINS)


def test_which_estimator_of_a_stored_run(folders, kept):
    others = [row | {"estimator": "other", "case": f"o{row['seed']}"} for row in rows()]
    two = (folders[0], kept("two", [*rows(), *others]))
    with pytest.raises(FlexaxisError, match=r"2 estimators; say which .*: e, other"):
        compare_runs(*two, MARGINS)
    with pytest.raises(FlexaxisError, match=r"Did you mean 'other'"):
        compare_runs(*two, MARGINS, estimators=(None, "othr"))
    assert compare_runs(*two, MARGINS, estimators=(None, "other")).candidate == "other"


SCENARIOS = ("s", "t", "u", "v", "w")


def of_many(seed=0, *, failed=(), without=()):
    """Rows on five scenarios with eight seeds; some cases failed, and some are not there."""
    noise = np.random.default_rng(seed).normal(0, 0.005, (5, 8))
    return [
        row
        | {"case": f"{name}{row['seed']}", "scenario": name, "hash": name, "failed": gone}
        | {"lag": 400.0 if gone else float(np.exp(noise[i, row["seed"]])), "diverged": gone}
        | {"error": "EstimatorCrash: no" if gone else None}
        for i, name in enumerate(SCENARIOS)
        for row in rows()
        for gone in [(name, row["seed"]) in failed]
        if name not in without and (name, row["seed"]) not in without
    ]


def test_cases_that_failed_are_lost_runs(kept):
    """34 of 40 failed, three scenarios wholly: what is left of it is the same as before."""
    gone = [(name, k) for name in "stu" for k in range(8)]
    gone += [(name, k) for name in "vw" for k in range(3, 8)]
    old, new = kept("old", of_many()), kept("new", of_many(failed=gone))
    found = compare_runs(old, new, MARGINS)
    assert (found.verdict, found.status(), found.newly_lost) == ("worse", 1, 34)
    assert "candidate failed in 34 runs" in headline(found)
    (lost,) = (v for v in found.verdicts if v.metric == "diverged")
    assert (lost.newly, lost.runs) == (34, 40)
    back = compare_runs(new, old, MARGINS)
    assert back.verdict != "same" and "base failed in 34 runs" in headline(back)
    assert back.status() == 0


def test_one_case_that_failed_does_not_pass(kept):
    found = compare_runs(kept("old", of_many()), kept("new", of_many(failed=[("s", 3)])), MARGINS)
    assert (found.verdict, found.status()) == ("undecided", 3)
    both = compare_runs(
        kept("a", of_many(failed=[("s", 3)])), kept("b", of_many(failed=[("s", 3)])), MARGINS
    )
    assert (both.verdict, both.status()) == ("same", 0)


def test_what_one_side_lacks_is_said_and_is_not_the_same(kept):
    old, new = kept("old", of_many()), kept("new", of_many(without=("t", ("u", 5))))
    assert compare_runs(old, old, MARGINS).verdict == "same"
    found = compare_runs(old, new, MARGINS)
    assert (found.verdict, found.status(), found.newly_lost) == ("undecided", 3, 0)
    said = headline(found)
    assert "candidate not run on 8 cases of t" in said and "not run on 1 cases of u" in said
    assert "nothing is the same" in meaning(found)
    back = compare_runs(new, old, MARGINS)
    assert (back.verdict, back.status()) == ("undecided", 0)
    assert "base not run on 8 cases of t" in headline(back)
    assert back.as_dict()["lacking"][0] == {
        "scenario": "t", "side": "base", "cases": 8, "unreadable": False}  # fmt: skip


def test_seeds_that_one_side_has_alone_are_not_lacking(kept):
    fewer = [row for row in of_many() if row["seed"] < 6]
    found = compare_runs(kept("old", of_many()), kept("new", fewer), MARGINS)
    assert (found.verdict, found.seeds, found.paired.lacking) == ("same", [*range(6)], ())


def test_who_is_better_where_both_ran_and_lacks_the_rest_is_not_better(kept):
    quick = [row | {"lag": row["lag"] / 2} for row in of_many(without=("t",))]
    old, new = kept("old", of_many()), kept("new", quick)
    assert compare_runs(old, new, MARGINS).verdict == "undecided"
    assert compare_runs(new, old, MARGINS).verdict == "worse"


def test_a_study_is_told_from_a_run(folders):
    (folders[1] / SUMMARY).unlink()
    with pytest.raises(FlexaxisError, match="no complete result"):
        compare_runs(*folders, MARGINS)
    (folders[1] / STUDY).write_text(json.dumps({"axes": ["fault[0].factor"]}))
    with pytest.raises(FlexaxisError, match=r"new is a study: .*flexaxis compare --base"):
        compare_runs(*folders, MARGINS)
