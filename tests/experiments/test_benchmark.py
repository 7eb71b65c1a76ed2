"""Runs do not depend on how they are spread; what fails says where, and loses nothing."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.estimator_text import build, parse
from flexaxis.experiments.cli import main
from flexaxis.experiments.reporting.inputs import RunInputs
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.storage import files
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark
from tests.experiments.kept_rows import scores_of

ESTIMATORS = ["rpem-forgetting", "frozen"]


def plan(scenario, *, estimators=ESTIMATORS, seeds=range(1000, 1003), scenarios=None, **swept):
    study = Study("t", tuple(scenarios or [scenario]), tuple(estimators), tuple(seeds))
    return Benchmark(study, title="t", command="flexaxis run short", **swept)


def without_cost(folder: Path):
    """Return the rows, in an order that does not depend on which came first."""
    return sorted(scores_of(folder).values(), key=lambda row: (row["case"], str(row["parameter"])))


@pytest.mark.slow
def test_scores_do_not_depend_on_the_number_of_processes(short, tmp_path):
    for jobs in (1, 2):
        benchmark(plan(short), tmp_path / str(jobs), Means(jobs=jobs))
    rows = without_cost(tmp_path / "1")
    assert rows == without_cost(tmp_path / "2")
    assert len(rows) == 2 * 3 * 3
    assert len({(r["case"], r["parameter"]) for r in rows}) == len(rows)


@pytest.mark.slow
def test_an_estimator_that_fails_on_some_seeds_is_lost_on_these(short, tmp_path):
    (tmp_path / "own.py").write_text(
        "class Odd:\n"
        "    names, output = ('k_T', '1/J_a', 'f_m'), 'speed'\n"
        "    def __init__(self, nominal, period):\n"
        "        self.k, self.theta = 0, [nominal['k_T'], 1 / nominal['J_a'], nominal['f_m']]\n"
        "    def step(self, u, y):\n"
        "        self.k += 1\n"
        "        if self.k == 1000 and y > 0: raise ZeroDivisionError('no luck')\n"
        "        return self.theta\n"
    )
    names = [*ESTIMATORS, "ekf", f"{tmp_path}/own.py:Odd"]
    other = short.override({"name": "other", "duration": 7.0})
    wanted = plan(short, estimators=names, seeds=range(1000, 1010), swept_scenarios=[other],
                  swept_estimators=[names[0], names[-1]])  # fmt: skip
    found = benchmark(wanted, tmp_path / "out")
    failed = {s.name: {row["seed"] for row in found.summary["failures"]
                       if row["scenario"] == s.name} for s in (short, other)}  # fmt: skip
    assert found.summary["tradeoff"]["left_out"] == names[-1:] and failed["other"]
    assert {row["estimator"] for row in found.summary["tradeoff"]["points"]} == {names[0]}
    failed = failed["short"]
    assert 0 < len(failed) < 10
    for entry in found.summary["as_set"]:
        lags = dict(zip(range(1000, 1010), entry["values"]["lag"], strict=True))
        odd = entry["estimator"].endswith("Odd")
        assert entry["diverged"] == (len(failed) if odd else 0)
        rows = [
            r
            for r in without_cost(tmp_path / "out")
            if r["estimator"] == entry["estimator"] and r["parameter"] == entry["parameter"]
        ]
        assert {r["seed"]: pytest.approx(np.log(r["lag"]), abs=1e-4) for r in rows} == lags
        assert {r["seed"] for r in rows if r["failed"]} == (failed if odd else set())


def test_any_executor_will_do(short):
    with ThreadPoolExecutor(2) as executor:
        bench = Bench([short], means=Means(executor=executor, in_flight=2))
        (runs,) = bench.runs([short], ["frozen"], range(4)).values()
    assert [run[0]["seed"] for run in runs] == [0, 1, 2, 3]


def test_a_folder_holds_what_the_report_needs(short, tmp_path):
    made = benchmark(plan(short), tmp_path)
    read = RunInputs.of(tmp_path)
    assert read.summary == json.loads(json.dumps(made.summary))
    traces = [inputs.traces(short.name, "rpem-forgetting") for inputs in (read, made)]
    np.testing.assert_array_equal(traces[0][0].curve, traces[1][0].curve)
    assert {f.name for f in tmp_path.iterdir()} == {
        "study.json",
        "scores.sqlite",
        "summary.json",
        "report.html",
    }
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert '<svg role="img"' in page and "rpem-forgetting" in page
    assert "src=" not in page.partition("<script>")[0]


def test_a_swept_knob_leads_the_report(short, tmp_path):
    swept = plan(short, swept_scenarios=[short], swept_estimators=["rpem-drift"])
    count = []
    means = Means(advance=lambda outcome: count.append(outcome.cases))
    made = benchmark(swept, tmp_path, means)
    assert swept.cases == 3 * (2 + 5 + 1)  # the reference comes along
    assert sum(count) >= swept.cases  # and more where five settings do not reach its noise
    matched = made.summary["tradeoff"]["matched"]
    assert [row["estimator"] for row in matched] == ["rpem-drift"]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    headings = ["Who is fastest at equal noise?", "At equal noise", "Speed against noise",
                'id="short"']  # fmt: skip
    places = [page.index(f">{text}<" if "id" not in text else text) for text in headings]
    assert places == sorted(places)
    assert "Scores" not in page  # one ranking, at equal noise, and no other beside it


class Wild:
    """Runs away, as a filter with a wrong sign would."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.theta = nominal["f_m"]

    def step(self, u, y):
        self.theta *= 2.0
        return [self.theta]


class Broken:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.count = 0

    def step(self, u, y):
        self.count += 1
        if self.count > 100:
            raise ZeroDivisionError("no luck")
        return [0.05]


def own(name):
    return f"{Path(__file__)}:{name}"


def test_a_diverging_estimator_is_counted_and_the_others_stay(short, tmp_path):
    made = benchmark(plan(short, estimators=[own("Wild"), "frozen"]), tmp_path)
    wild, *frozen = made.summary["rows"]
    # f_m doubles a sample: lost before the fault, and 17 D off (.5 against .075) for all of 2 s
    assert wild["diverged"] == 3 and wild["lag"] == pytest.approx(2 * (0.5 - 0.075) / 0.025)
    assert all(row["diverged"] == 0 for row in frozen)
    assert main(["export", str(tmp_path), "--jsonl", str(tmp_path / "rows.jsonl")]) == 0
    for line in (tmp_path / "rows.jsonl").read_text().splitlines():
        json.loads(line, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def test_an_estimator_that_raises_is_a_row_and_the_others_go_on(short, tmp_path):
    made = benchmark(plan(short, estimators=[own("Broken"), "frozen"], seeds=[7, 8]), tmp_path)
    lost = {row["estimator"]: row["failed"] for row in made.summary["rows"]}
    assert lost == {own("Broken"): 2, "frozen": 0}
    failed = made.summary["failures"]
    assert [row["seed"] for row in failed] == [7, 8]
    assert {row["estimator"] for row in failed} == {own("Broken")}
    where = "crashed on short, seed 7, sample 100 (0.5 s)"
    assert f"{where}: ZeroDivisionError: no luck" in failed[0]["error"]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "2 cases could not be run" in page and "no luck" in page


def test_a_simulation_that_fails_is_a_row_and_the_others_go_on(short, tmp_path):
    late = short.override({"name": "late", "controller.Kv": 50.0})  # unstable: the engine warns
    made = benchmark(plan(short, scenarios=[late, short], estimators=["frozen"], seeds=[5]),
                     tmp_path)  # fmt: skip
    assert {row["scenario"] for row in made.summary["rows"]} == {"short"}
    (failed,) = made.summary["failures"]
    assert failed["error"].startswith("SimulationError: late, seed 5: ")


@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(short, tmp_path):
    """Also where estimators and seeds were added since; nothing is run twice."""
    whole = plan(short, estimators=["frozen", "ekf"], seeds=range(6))
    counted = []
    means = Means(advance=lambda outcome: counted.append(outcome.cases))
    benchmark(plan(short, estimators=["frozen"], seeds=range(4)), tmp_path / "a", means)
    benchmark(whole, tmp_path / "a", means)
    assert sum(counted) == 12
    benchmark(whole, tmp_path / "b")
    assert without_cost(tmp_path / "a") == without_cost(tmp_path / "b")
    summaries = [RunInputs.of(tmp_path / name) for name in "ab"]
    rows = [[{k: v for k, v in row.items() if k != "cost"} for row in s.summary["rows"]]
            for s in summaries]  # fmt: skip
    assert rows[0] == rows[1]
    ((first, *_), (second, *_)) = (s.traces(short.name, "ekf").values() for s in summaries)
    np.testing.assert_array_equal(first.curve, second.curve)


def test_a_folder_that_cannot_be_written_is_found_first(short, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(files.OutputError, match="cannot be written"):
        benchmark(plan(short), tmp_path / "file" / "out")


def test_a_full_disk_is_said_in_one_line(short):
    with pytest.raises(files.OutputError, match="/dev/full: cannot be written: No space left"), \
            files.writing(Path("/dev/full")), open("/dev/full", "w") as file:  # fmt: skip
        file.write("x")


def test_specs(short):
    estimator = build(parse("rpem-forgetting[forgetting=0.99, regularization=1e-6]"), short)
    assert estimator.names == ("k_T", "1/J_a", "f_m")
    with pytest.raises(EstimatorError, match="Did you mean 'rpem-drift'"):
        parse("rpem-drft")
    with pytest.raises(EstimatorError, match=r"no option 'forgeting'.*'forgetting'"):
        parse("rpem-forgetting[forgeting=0.99]")
    with pytest.raises(EstimatorError, match="write options as in"):
        parse("rpem-forgetting[0.99]")
    with pytest.raises(EstimatorError, match=r"forgetting is 1\.5"):
        build(parse("rpem-forgetting[forgetting=1.5]"), short)
    with pytest.raises(EstimatorError, match="has no 'Nobody'"):
        parse(own("Nobody"))
    with pytest.raises(EstimatorError, match="no such file"):
        parse("missing.py:Mine")
    with pytest.raises(EstimatorError, match="reads 'speed'"):
        build(parse(own("Wild")), short.override({"output": "increment"}))


@pytest.mark.slow
def test_other_parameters_get_their_P0_from_a_nominal_run(short):
    scenario = short.override({"identify": ["k_T", "f_m", "1/J_m"]})
    estimator = build(parse("rpem-forgetting"), scenario)
    assert estimator.names == ("k_T", "f_m", "1/J_m")
    assert (np.diag(estimator.P) > 0).all()


def test_points_of_a_sweep_are_told_the_same_nominal_torque(short):
    """Which comes from random numbers of its own: neither from those of the records, nor anew."""
    from flexaxis.experiments.scoring.nominal import nominal_torque

    torque = nominal_torque(short)
    for changes in ({"fault[0].factor": 2.0}, {"start": 1.2}):
        point = short.override(changes, inherit=True)
        assert point.streams == short.key
        np.testing.assert_array_equal(nominal_torque(point), torque)


def test_start_is_told_through_the_nominal_values(short):
    estimator = build(parse("frozen"), short.override({"start": 1.2}))
    np.testing.assert_allclose(estimator.step(0.0, 0.0), [1.2, 1.2 / 0.8, 0.06], rtol=1e-12)


class Far:
    """Once throws its estimate very far for half a second, and is not lost for that."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.nominal, self.count = nominal["f_m"], 0

    def step(self, u, y):
        self.count += 1
        return [1e200 if 500 <= self.count < 600 else self.nominal]


STEP = {"kind": "step", "parameter": "f_m", "at": 6.0, "factor": 1.5}


@pytest.mark.parametrize(
    "changes",
    [
        {"noise.speed": 0.0},
        {"fault[0].factor": 0.0},
        pytest.param(
            {"excitation.pause": [[4.0, 7.0]],
             "fault": [STEP | {"at": 5.0}, STEP | {"parameter": "J_a"}]},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"fault": [STEP | {"kind": "ramp", "at": 3.0, "over": 4.0, "factor": 2.0}, STEP]},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["no noise", "to zero", "overtaken in a pause", "overlapping"],
)  # fmt: skip
def test_what_is_odd_in_a_scenario_ends_in_a_report(short, tmp_path, changes):
    """And where nothing is defined, that is what the rows say."""
    scenario = short.override(changes | {"name": "odd"})
    estimators = ["rpem-forgetting", "glr", "frozen", own("Far")]
    wanted = plan(scenario, estimators=estimators, seeds=[0], swept_scenarios=[scenario],
                  swept_estimators=["rpem-drift"])  # fmt: skip
    rows = {
        (r["estimator"], r["parameter"]): r for r in benchmark(wanted, tmp_path).summary["rows"]
    }
    still = rows["frozen", "f_m"]
    assert still["lag"] > 0 and still["never_settled"] == 1
    assert (still["score"] is None) == (changes != {"fault[0].factor": 0.0})
    assert (rows["glr", "f_m"]["excess"] is None) == ("noise.speed" in changes)
    assert rows[own("Far"), "f_m"]["diverged"] == 0
    assert (tmp_path / "report.html").exists()
