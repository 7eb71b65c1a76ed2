"""`import flexaxis as fx`: quick, the same numbers as every other way, and it shows its content."""

import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from identify_axes import VALUES, log

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running.case import run_case
from flexaxis.experiments.running.estimators import parse, text_of
from flexaxis.experiments.running.user_code import EstimatorCrash
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.simulate import simulate

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def no_window():
    mpl.use("Agg")
    yield
    from matplotlib import pyplot

    pyplot.close("all")


class Still:
    """Stays at nominal f_m."""

    names = ("f_m",)
    output = "speed"

    def __init__(self, nominal, period):
        self.theta = [nominal["f_m"]]

    def step(self, u, y):
        return self.theta


class Lost(Still):
    def step(self, u, y):
        return [float("nan")]


def test_importing_it_imports_nothing_heavy():
    code = "import sys, flexaxis; dir(flexaxis); print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = out.stdout.split()
    assert not {"numpy", "scipy", "numba", "mujoco", "matplotlib"} & set(modules)


def test_a_run_is_that_of_the_simulation(short):
    shown, plain = fx.simulate(short, seed=np.int64(3)), simulate(short, [3])[0]
    np.testing.assert_array_equal(shown.speed, plain.speed)
    other = fx.simulate("fm_step", **{"fault[0].factor": 2, "duration": 12.0})
    assert other.true_parameters[-1, other.parameter_names.index("f_m")] == 0.1
    for wrong, words in (("fm_stp-v1", "Did you mean 'fm_step-v1'"), ("smoke", "suite")):
        with pytest.raises(FlexaxisError, match=words):
            fx.simulate(wrong)
    with pytest.raises(FlexaxisError, match=r"Did you mean 'fault\[0\].factor'"):
        fx.simulate("fm_step", **{"fault.factor": 2})


@pytest.mark.parametrize("estimator", ["rpem-forgetting", "glr", Still])
def test_scores_are_those_of_a_benchmark(short, estimator):
    record = fx.simulate(short, seed=1000)
    scores = fx.score(fx.estimate(record, estimator))
    results = fx.benchmark(estimator, scenarios=short, seeds=1)
    pooled = results.pooled()
    assert len(scores) == len(results.frame) > 0
    shared = ["lag", "bias", "cross_talk", "diverged"]
    np.testing.assert_array_equal(
        scores[shared].to_numpy(float), results.frame[shared].to_numpy(float)
    )
    assert [*scores["std"]] == [line["std"] for line in pooled]  # about the mean, as of many runs


def test_an_estimate_is_that_of_a_case_and_can_be_drawn(short):
    record = fx.simulate(short)
    result = fx.estimate(record, "rpem-forgetting[forgetting=0.9375]")
    assert result.estimator == "rpem-forgetting[forgetting=0.9375]"
    case = run_case(short, simulate(short, [0])[0], parse(result.estimator))
    np.testing.assert_array_equal(result.theta, case.theta)
    assert result.covariance.shape == (*result.theta.shape, len(result.names))
    assert result.last["f_m"] == result.theta[-1, 2] == result.to_dataframe()["f_m"].iloc[-1]
    assert "f_m" in repr(result)
    axes = result.plot()
    again = fx.estimate(record, "frozen").plot(ax=axes)
    assert [ax is other for ax, other in zip(axes, again, strict=True)] == [True] * 3
    assert [line.get_label() for line in axes[2].lines].count("truth") == 1
    with pytest.raises(EstimatorError, match="Did you mean 'f_m'"):
        result.plot("f_n")


def test_an_own_class_estimates(short):
    record = fx.simulate(short)
    assert fx.estimate(record, Still).last == {"f_m": 0.05}
    with pytest.raises(EstimatorError, match="An instance of a class is not accepted"):
        fx.estimate(record, Still(short.nominal.as_dict(), 0.005))
    results = fx.benchmark([Still, "frozen"], scenarios=[short], seeds=range(2), time_limit=60.0)
    assert set(results.to_dataframe()["estimator"]) == {text_of(Still), "frozen"}

    class Ends(Still):
        def step(self, u, y):
            raise SystemExit(3)

    with pytest.raises(EstimatorCrash, match=r"Ends crashed .*sample 0"):
        fx.estimate(record, Ends)


def test_an_estimate_that_is_not_finite_counts_as_diverged(short):
    assert np.isnan(fx.estimate(fx.simulate(short), Lost).last["f_m"])
    results = fx.benchmark(Lost, scenarios=short, seeds=1)
    assert results.to_dataframe()["diverged"].all()


def test_results_are_a_table_and_a_figure(short, tmp_path):
    results = fx.benchmark(["rpem-forgetting", "frozen"], scenarios=[short], seeds=2)
    frame = results.to_dataframe()
    assert {"estimator", "scenario", "seed", "parameter", "lag"} <= set(frame.columns)
    assert "lag_interval" in results.scores("estimator") and results.plot().get_xscale() == "log"
    line = results.table.query("estimator == 'frozen'").iloc[0]
    lags = frame[(frame.estimator == "frozen") & (frame.parameter == "f_m")].lag
    assert line["lag"] == pytest.approx(lags.mean())
    text = repr(results)
    assert "4 cases" in text and "lag" in text and "frozen" in text
    kept = fx.benchmark("frozen", scenarios=short, seeds=1, folder=tmp_path / "kept")
    assert fx.load(tmp_path / "kept").cases == kept.cases == 1
    assert (tmp_path / "kept" / "report.html").exists()
    with pytest.raises(FlexaxisError, match="column 'nope'"):
        results.plot("nope")


def test_an_axis_stepped_by_hand_is_the_plant_of_the_record(short):
    noisy = short.override({"noise.torque": 0.01, "encoder.counts": 65536})
    record, axis = fx.simulate(noisy, seed=2), fx.make_axis(noisy, seed=2)
    for k, torque in enumerate(record.torque):
        assert axis.sample.speed == record.speed[k] and axis.sample.angle == record.angle[k]
        assert axis.sample.increment == record.increment[k]
        if not axis.done:
            axis.step(torque)
    assert axis.done
    with pytest.raises(FlexaxisError, match="make a new axis"):
        axis.step(0.0)
    with pytest.raises(FlexaxisError, match=r"failed at t = 0\.005 s"):
        fx.make_axis(short).step(float("nan"))


def test_a_log_is_imported_identified_and_tracked(tmp_path):
    path, record = tmp_path / "log.csv", log(1, 0, "multisine", seed=0, seconds=8.0)
    rows = np.column_stack([record.time, record.torque, np.degrees(record.angle)])
    head = "time [s],torque [Nm],angle [deg]"
    np.savetxt(path, rows, "%.12g", ",", header=head, comments="")
    read = fx.import_log(path, torque_is="held")
    assert set(read.table["kind"]) <= {"ok", "note", "info"}
    found = fx.identify(read, "one_mass", friction="none")
    assert found.table["value"]["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.01)
    for result in (read, found):
        assert np.ravel(np.asarray(result.plot(), dtype=object))[0].lines
    followed = fx.track(read, found, ["1/J_m"])
    assert followed.table["ratio"]["1/J_m"] == pytest.approx(1, abs=0.02)
    assert "no parameter changed" in repr(followed)


@pytest.mark.slow
def test_the_examples_of_the_documentation_run():
    import re

    held: dict[str, object] = {}
    for name in ("README.md", "docs/python.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            if "fx." in code:
                exec(compile(code, name, "exec"), held)
    assert {"glr", "rpem-forgetting"} == set(held["frame"]["estimator"])
    assert held["sample"].time == pytest.approx(11.995)
