"""A study from file to folder: what is wrong is told first, what is there is not run again."""

import pandas as pd
import pytest

from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running.results import FIRST, LAST, Results
from flexaxis.experiments.running.study import missing, units
from flexaxis.experiments.scoring.score_table import columns
from flexaxis.experiments.studies.definition import load_study, study_from
from flexaxis.sim.scenario import Scenario
from tests.experiments.command import flexaxis

COLUMNS = (*FIRST, *columns(), *LAST)
FILE = """\
scenario = "short.toml"
estimators = ["rpem-forgetting", "frozen"]
seeds = 2
[override]
duration = 4.0
"fault[0].at" = 2.5
[sweep]
fault[0].factor = [1.5, 2.0]
rpem-forgetting.forgetting = [0.99, 0.995]
""".replace("\nfault[0].factor", '\n"fault[0].factor"')


@pytest.fixture
def study_toml(short_toml, tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


# ---------------------------------------------------------------- the file


def test_all_problems_of_a_file_at_once(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(
        'scenario = "fm_stp-v1"\nestimators = ["rpem-forgeting"]\nseeds = 4\n'
        '[sweep]\n"start" = 1.2\n"fault[0].factor" = []\n'
    )
    with pytest.raises(StudyError) as caught:
        load_study(path)
    text = str(caught.value)
    assert all(line.startswith(str(path)) for line in text.splitlines())
    for words in ("'fm_step-v1'", "'rpem-forgetting'", "sweep.start: must be an array",
                  "sweep.fault[0].factor: the array must have"):  # fmt: skip
        assert words in text, text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sweeps": {}}, "unknown key 'sweeps'"),
        ({"seeds": "9:3"}, "give a number of seeds"),
        ({"seeds": 0}, "give a number of seeds"),
        ({"override": {"fault[3].factor": 2.0}}, "does not exist"),
        ({"sweep": {"frozn.gain": [1.0]}}, "Did you mean 'frozen'"),
        ({"sweep": {"falt[0].factor": [1.0]}}, "Did you mean 'fault'"),
        ({"sweep": {"fault.factor": [1.0]}}, "Did you mean 'fault[0].factor'"),
        ({"sweep": {"fault.at": [8.0], "fault[1].at": [8.0]}}, "fault[1].at: the key does not"),
        ({"sweep": {"start": [-1.0]}, "estimators": ["glrr"], "x": 1}, "fm_step-v1: start: must"),
        ({"sweep": {"start": [-1.0]}, "estimators": ["glrr"], "x": 1}, "Did you mean 'glr'"),
        ({"sweep": {"start": [-1.0]}, "estimators": ["glrr"], "x": 1}, "unknown key 'x'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(changes, words):
    given = {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen"], "seeds": 1}
    with pytest.raises(StudyError) as caught:
        study_from(given | changes)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ({"fault[0].factor": [1.5, -2.0]}, "[0].factor = -2.0: fm_step-v1: fault[0].factor: must"),
        ({"fault[0].fctor": [1.5]}, "Did you mean 'factor'"),
        ({"estimator.forgeting": [0.9]}, "forgeting = 0.9: rpem-forgetting has no option"),
        ({"duration": [20.0, 8.0]}, "duration = 8.0: fm_step-v1: fault[0].at: the onset at 10 s"),
    ],
)  # fmt: skip
def test_a_point_that_cannot_be_run_names_key_and_value(sweep, words):
    keys = {"name": "s", "scenario": "fm_step-v1", "estimators": ["rpem-forgetting"], "seeds": 1}
    with pytest.raises(StudyError) as caught:
        study_from(keys | {"sweep": sweep})
    assert words in str(caught.value)


# ---------------------------------------------------------------- the plan


def study_of(sweep, **more):
    table = {"name": "s", "scenario": "fm_step-v1", "estimators": ["rpem-forgetting"], "seeds": 3}
    return study_from(table | {"sweep": sweep} | more)


def test_points_that_define_the_same_run_are_one():
    every = missing(units(study_of({"fault[0].factor": [1.5, 2.0, 1.5]})), set())
    assert len({unit.scenario.hash for unit in every}) == 2


def test_quotes_around_dotted_keys_are_optional(tmp_path):
    table = "scenario = 'fm_step-v1'\nestimators = ['frozen']\nseeds = 1\n"
    for number, sweep in enumerate(
        ("excitation.low = [0.1, 0.2]", '"excitation.low" = [0.1, 0.2]')
    ):
        (tmp_path / f"{number}.toml").write_text(table + "[sweep]\n" + sweep)
    one, two = (load_study(tmp_path / f"{number}.toml") for number in (0, 1))
    assert one.points == two.points


@pytest.mark.slow
def test_a_study_from_the_command_line(study_toml, tmp_path, capsys):
    """Run, added to, put together from shards, run again, and reported."""
    words = ["study", study_toml, "-o"]
    assert flexaxis(capsys, *words, tmp_path / "a", "--jobs", 2)[0] == 0
    whole = Results.load(tmp_path / "a")
    assert whole.cases == 12
    for i in (1, 2):
        flexaxis(capsys, *words, tmp_path / f"s{i}", "--shard", f"{i}/2")
    shards = [tmp_path / "s1", tmp_path / "s2"]
    assert flexaxis(capsys, "run", "--from", *shards, "-o", tmp_path / "b")[0] == 0
    cost = [name for name in whole.frame if name.startswith("cost.")]
    pd.testing.assert_frame_equal(
        Results.load(tmp_path / "b").frame.drop(columns=cost), whole.frame.drop(columns=cost)
    )
    assert (tmp_path / "b" / "report.html").exists()


def test_no_axis_can_take_the_name_of_a_column():
    assert not {column.split(".")[0] for column in COLUMNS} & set(Scenario.model_fields)


def test_the_documentation_has_every_column():
    from pathlib import Path

    text = (Path(__file__).parents[2] / "docs" / "studies.md").read_text(encoding="utf-8")
    missing = [c for c in COLUMNS if f"`{c}`" not in text and f"`{c.split('.')[0]}.N`" not in text]
    assert not missing


def test_the_examples_can_be_run():
    from pathlib import Path

    examples = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.toml"))
    assert examples
    for path in examples:
        assert units(load_study(path))
