"""A result that makes room for another: what goes with it is said."""

from pathlib import Path

import pytest

from flexaxis.experiments.running import previous
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.studies.definition import study_from


@pytest.fixture
def complete(monkeypatch, tmp_path):
    """A function that makes a complete result in a folder, as a run does, in little time."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import study_stubs

    def make(seeds, scenario="fm_step-v1", **how):
        study = study_from(
            {"name": "s", "scenario": scenario, "estimators": ["frozen"], "seeds": seeds}
        )
        run_study(study, tmp_path, Means(work=study_stubs.quick), replace=True, **how)
        (tmp_path / "summary.json").write_text("{}")
        previous.completed(tmp_path)

    return make


@pytest.mark.parametrize(
    ("again", "said"),
    [
        ({"seeds": 3}, None),  # the same question, and one with more of it
        ({"seeds": 4}, None),
        ({"seeds": 3, "resume": True}, None),
        ({"seeds": 1}, "replaces 3 cases of: fm_step-v1 ("),
        ({"seeds": 3, "scenario": "kt_step-v1"}, "another folder with -o keeps them"),
    ],
)
def test_cases_that_the_new_result_has_not_are_told(complete, capsys, again, said):
    complete(3)
    complete(**again)
    told = capsys.readouterr().err
    assert said in told if said else not told


def test_a_line_that_is_typed_again_replaces_in_silence(complete, capsys):
    about = {"about": {"command": "flexaxis compare"}}
    complete(3, **about)
    complete(2, **about)
    assert not capsys.readouterr().err
    complete(1, about={"command": "flexaxis compare --seeds 1"})
    told = capsys.readouterr().err
    assert "replaces 2 cases of: flexaxis compare; --resume keeps them" in told
