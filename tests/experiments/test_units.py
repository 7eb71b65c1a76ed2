"""Units of work: each case once, in one shard, under an id that its inputs decide."""

from __future__ import annotations

import pytest
from engine_cases import short, small_study, user_file

from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running.study import Study, applies, missing, units


def ids(every):
    return [case for unit in every for case, _, _ in unit.cases()]


def test_a_study_has_each_case_once():
    study = small_study("frozen", "rpem-forgetting", seeds=5)
    found = ids(units(study))
    assert len(found) == len(set(found)) == 2 * 2 * 5


def test_two_points_that_are_one_run_are_run_once():
    study = Study("twice", (short(),), ("frozen",), (0,), ("start",), ({"start": 1.1},) * 2)
    assert len(ids(missing(units(study), set()))) == 1


def test_options_are_swept_for_the_estimator_that_has_them():
    points = tuple({"rpem-forgetting.forgetting": x} for x in (0.99, 0.995))
    study = Study("options", (short(),), ("frozen", "rpem-forgetting"), (0,),
                  ("rpem-forgetting.forgetting",), points)  # fmt: skip
    texts = {setting.text for unit in units(study) for setting in unit.settings}
    assert texts == {"frozen", *(f"rpem-forgetting[forgetting={x}]" for x in (0.99, 0.995))}
    assert applies("estimator.forgetting", "rpem-forgetting[drift=1]")


@pytest.mark.parametrize("shards", [2, 3])
def test_shards_are_disjoint_and_complete(shards):
    every = units(small_study(seeds=40))
    parts = [ids(every[i::shards]) for i in range(shards)]
    assert sorted(case for part in parts for case in part) == sorted(ids(every))


def test_what_is_done_is_not_run_again():
    every = units(small_study(seeds=3))
    done = set(ids(every)[::2])
    assert set(ids(missing(every, done))) == set(ids(every)) - done


def test_another_file_of_a_user_gives_other_cases(tmp_path):
    text = f"{user_file(tmp_path)}:Mine"
    before = ids(units(small_study(text)))
    assert ids(units(small_study(text))) == before
    (tmp_path / "mine.py").write_text((tmp_path / "mine.py").read_text() + "\n# changed\n")
    assert not set(ids(units(small_study(text)))) & set(before)


def test_each_problem_names_its_point():
    points = ({"fault[0].factor": -1.0}, {"fault[0].factor": 1.5})
    study = Study("wrong", (short(),), ("frozen",), (0,), ("fault[0].factor",), points)
    with pytest.raises(StudyError, match=r"wrong: sweep: .*-1\.0.*factor"):
        units(study)


def test_a_wrong_option_is_answered_with_the_nearest():
    study = Study("wrong", (short(),), ("rpem-forgetting[forgeting=0.9]",), (0,))
    with pytest.raises(StudyError, match="Did you mean 'forgetting'"):
        units(study)


def test_scenarios_of_one_name_are_refused():
    other = short().override({"fault[0].factor": 2.0, "name": short().name})
    with pytest.raises(StudyError, match="could not be distinguished"):
        Study("twins", (short(), other), ("frozen",), (0,))
