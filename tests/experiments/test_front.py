"""The front door: quick, the same numbers as every other way, and it shows what it holds."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.case import run_case
from flexaxis.experiments.running.estimators import parse
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

    def __init__(self, nominal, period, *, factor=1.0):
        self.theta = [factor * nominal["f_m"]]

    def step(self, u, y):
        return self.theta


def test_importing_it_imports_nothing_heavy():
    code = (
        "import sys, time; t = time.perf_counter(); import flexaxis; dir(flexaxis);"
        "print(time.perf_counter() - t, *sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    seconds, *modules = told.stdout.split()
    assert float(seconds) < 0.2
    assert not {"numpy", "scipy", "numba", "mujoco", "matplotlib"} & set(modules)


def test_it_says_what_there_is():
    assert set(dir(fx)) == set(fx.__all__)
    for name in fx.__all__:
        assert getattr(fx, name) is not None
    assert fx.__version__[0].isdigit()
    with pytest.raises(AttributeError, match="did you mean 'simulate'"):
        fx.simulat  # noqa: B018


def test_what_type_checkers_see_is_what_there_is():
    import ast

    tree = ast.parse((ROOT / "experiments/front/__init__.py").read_text(encoding="utf-8"))
    seen = {
        (alias.name, node.module.removeprefix("flexaxis."))
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("flexaxis._")
        for alias in node.names
    }
    home = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "_HOME"
    )
    # `estimators` is the package, which lists itself, and is imported where it is called.
    assert seen - {("estimators", "_check")} == set(home.items())
    assert set(home) | {"__version__", "estimators"} == set(fx.__all__)
    modules = {f.name for f in (ROOT / "experiments/front").iterdir() if f.suffix == ".py"}
    links = {f.name for f in (ROOT / ".typing/flexaxis").iterdir() if f.suffix == ".py"}
    assert links == modules


def test_the_package_of_estimators_lists_them_however_it_was_imported():
    code = "; ".join(
        [
            "import flexaxis.estimators as package, flexaxis as fx",
            "from flexaxis.estimators import RECOMMENDED",
            "assert fx.estimators is package and RECOMMENDED in fx.estimators()",
        ]
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert "ekf" in fx.estimators(find="KALMAN") and "frozen" not in fx.estimators(find="kalman")


def test_scenarios_are_found_by_group_and_text():
    steps = fx.scenarios(group="steps")
    assert "fm_step-v1" in steps and "paper_nominal-v1" not in steps
    assert set(fx.scenarios(find="stribeck")) < set(fx.scenarios())
    assert "fm_step-v1" in repr(steps) and "<td>fm_step-v1</td>" in steps._repr_html_()
    with pytest.raises(FlexaxisError, match="Did you mean 'steps'"):
        fx.scenarios(group="step")


def test_a_run_is_that_of_the_simulation(short):
    shown, plain = fx.simulate(short, seed=3), simulate(short, [3])[0]
    np.testing.assert_array_equal(shown.speed, plain.speed)
    other = fx.simulate("fm_step-v1", **{"fault[0].factor": 2, "duration": 12.0})
    assert other.true_parameters[-1, other.parameter_names.index("f_m")] == 0.1
    with pytest.raises(FlexaxisError, match="Did you mean 'fm_step-v1'"):
        fx.simulate("fm_stp-v1")
    with pytest.raises(FlexaxisError, match="suite"):
        fx.simulate("smoke")


@pytest.mark.parametrize("estimator", ["rpem-forgetting", "glr", Still])
def test_scores_are_those_of_a_benchmark(short, estimator):
    record = fx.simulate(short, seed=1000)
    scores = fx.score(fx.estimate(record, estimator))
    found = fx.benchmark(estimator, scenarios=short, seeds=1)
    rows = found.frame.astype(object).where(found.frame.notna(), None).to_dict("records")
    pooled = found.pooled()
    assert len(scores) == len(rows) > 0
    for one, row, line in zip(scores, rows, pooled, strict=True):
        shared = {"lag", "bias", "cross_talk", "nees", "nis", "excess", "diverged"}
        assert {key: one.get(key) for key in shared} == {key: row.get(key) for key in shared}
        for name in ("std", "std_after"):  # about the mean, as of many runs
            assert one[name] == line[name] and (row[name] is None or one[name] <= row[name])


def test_an_estimate_shows_itself(short):
    record = fx.simulate(short)
    found = fx.estimate(record, "rpem-forgetting", options={"forgetting": 0.99})
    assert found.estimator == "rpem-forgetting[forgetting=0.99]"
    case = run_case(short, simulate(short, [0])[0], parse(found.estimator))
    np.testing.assert_array_equal(found.theta, case.theta)
    assert found.covariance.shape == (*found.theta.shape, len(found.names))
    assert found.last["f_m"] == found.theta[-1, 2]
    assert len(repr(found)) < 500 and "f_m" in found._repr_html_()
    axes = found.plot()
    again = fx.estimate(record, "frozen").plot(ax=axes)
    assert [ax is other for ax, other in zip(axes, again, strict=True)] == [True] * 3
    assert [line.get_label() for line in axes[2].lines].count("truth") == 1
    with pytest.raises(FlexaxisError, match="give as many"):
        found.plot(ax=axes[:2])
    with pytest.raises(EstimatorError, match="Did you mean 'f_m'"):
        found.plot("f_n")


def test_a_peak_does_not_hide_the_truth(short):
    """The limits of the axis follow the truth and the bulk of the estimates."""
    found = fx.estimate(fx.simulate(short), Still)
    theta, truth = found.theta.copy(), found.truth["f_m"]
    theta[100, 0] = 50.0 * truth.max()
    low, high = replace(found, theta=theta).plot().get_ylim()
    assert low <= truth.min() and truth.max() <= high < theta[100, 0]


def test_an_own_class_and_an_instance_of_it_estimate(short):
    record = fx.simulate(short)
    assert fx.estimate(record, Still, options={"factor": 2.0}).last == {"f_m": 0.1}
    assert fx.estimate(record, Still(short.nominal.as_dict(), 0.005)).last == {"f_m": 0.05}
    with pytest.raises(EstimatorError, match="not an instance"):
        fx.benchmark([Still(short.nominal.as_dict(), 0.005)], scenarios=short)


def test_a_class_of_the_session_takes_part_under_its_name(short):
    class Local(Still):
        pass

    found = fx.benchmark([Local, "frozen"], scenarios=short, seeds=range(2))
    assert set(found.to_dataframe()["estimator"]) == {"Local", "frozen"}


def test_what_is_to_be_known_of_a_class_is_a_warning(short):
    class Lost(Still):
        def step(self, u, y):
            return [float("nan")]

    with pytest.warns(UserWarning, match=r"Lost returned an estimate that is not finite"):
        found = fx.benchmark(Lost, scenarios=short, seeds=1)
    assert found.to_dataframe()["diverged"].all()


def test_a_record_shows_itself(short, tmp_path):
    record = fx.simulate(short)
    assert repr(record) == "Record short, seed 0: 1600 samples of 5 ms"
    frame, cube = record.to_dataframe(), record.to_xarray()
    np.testing.assert_array_equal(frame["speed"], record.speed)
    assert frame["true_f_m"].iloc[-1] == pytest.approx(0.075)
    np.testing.assert_array_equal(cube.true_parameters.sel(parameter="f_m"), frame["true_f_m"])
    assert cube.torque.attrs["units"] == "N m"
    assert len(record.plot()) == 2 and record.plot("angle").get_ylabel() == "angle [rad]"
    loaded = fx.load(record.save(tmp_path / "r.nc"))
    assert repr(loaded) == repr(record) and fx.estimate(tmp_path / "r.nc", "frozen").names


@pytest.mark.parametrize("given", [None, 3, b"r.nc"])
def test_what_is_no_path_is_not_loaded(given):
    with pytest.raises(FlexaxisError, match="is no path: give the file of a record"):
        fx.load(given)


def test_results_are_a_table_a_cube_and_a_figure(short, tmp_path):
    found = fx.benchmark(["rpem-forgetting", "frozen"], scenarios=[short], seeds=2)
    frame = found.to_dataframe()
    assert {"estimator", "scenario", "seed", "parameter", "lag"} <= set(frame.columns)
    assert found.to_xarray().lag.sel(estimator="frozen", parameter="f_m").sizes["seed"] == 2
    assert "lag_interval" in found.scores("estimator")
    assert found.plot().get_xscale() == "log"
    line = found.scores().query("estimator == 'frozen' and changed").iloc[0]
    lags = frame[(frame.estimator == "frozen") & (frame.parameter == "f_m")].lag
    assert line["lag"] == pytest.approx(lags.mean())
    assert "4 cases" in repr(found) and "<table" in found._repr_html_()
    kept = fx.benchmark("frozen", scenarios=short, seeds=1, folder=tmp_path / "kept")
    assert fx.load(tmp_path / "kept").cases == kept.cases == 1


def test_a_study_is_that_of_the_command(short_toml, tmp_path, capsys):
    content = {"scenario": str(short_toml), "estimators": ["frozen"], "seeds": 2}
    content["sweep"] = {"fault[0].factor": [1.2, 2.0]}
    found = fx.study(content)
    lines = [f"{key} = {json.dumps(value)}" for key, value in content.items() if key != "sweep"]
    lines += ["[sweep]", '"fault[0].factor" = [1.2, 2.0]']
    path = tmp_path / "s.toml"
    path.write_text("\n".join(lines))
    assert main(["study", str(path), "-o", str(tmp_path / "out"), "--jobs", "1"]) == 0
    capsys.readouterr()
    other = fx.load(tmp_path / "out").to_dataframe()
    mine = found.to_dataframe()
    assert mine["lag"].equals(other["lag"]) and len(mine) == 18  # a twin without the fault each
    assert "after the fault" in found.plot().get_xlabel()  # the axis in words, not as a key
    with pytest.raises(FlexaxisError, match="fault"):
        found.plot("fault[0].factr")


def test_an_axis_stepped_by_hand_is_the_plant_of_the_record(short):
    noisy = short.override({"noise.torque": 0.01, "encoder.counts": 65536})
    record, axis = fx.simulate(noisy, seed=2), fx.make_axis(noisy, seed=2)
    for k, torque in enumerate(record.torque):
        assert axis.sample.speed == record.speed[k] and axis.sample.angle == record.angle[k]
        assert axis.sample.increment == record.increment[k]
        if not axis.done:
            axis.step(torque)
    assert axis.done and axis.parameters["f_m"] == pytest.approx(0.075)
    with pytest.raises(FlexaxisError, match="reset"):
        axis.step(0.0)
    assert axis.reset().speed == record.speed[0]
    with pytest.raises(FlexaxisError, match="finite"):
        axis.step(float("nan"))


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


def test_an_axis_stepped_by_hand_learns_on_the_way():
    """With the torque of a record it says what the estimator says of the record."""
    short = {"duration": 2.0, "fault[0].at": 1.0}
    record = fx.simulate("fm_step-v1", seed=2, **short)
    theta = fx.estimate(record, "rpem-forgetting").theta
    axis = fx.make_axis("fm_step-v1", seed=2, estimator="rpem-forgetting", **short)
    assert axis.estimates == {}
    for k, torque in enumerate(record.torque[:-1].tolist()):
        axis.step(torque)
        np.testing.assert_allclose(list(axis.estimates.values()), theta[k], rtol=1e-12)
    axis.reset()
    assert axis.estimates == {} and fx.make_axis(**short).estimates == {}
