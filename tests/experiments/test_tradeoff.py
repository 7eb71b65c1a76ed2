"""The trade-off sweep, its matching, and the tuning of a knob."""

import json

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.cli import main
from flexaxis.experiments.tradeoff import figure, matched, with_knob


def point(estimator, ratio, lag, **more):
    return {
        "scenario": "s", "parameter": "f_m", "estimator": estimator, "ratio": ratio, "lag": lag,
        "lag_interval": None, "std": ratio, "own_ratio": ratio, "bound": 0.1,
    } | more  # fmt: skip


def test_knobs():
    assert with_knob("rpem-forgetting", 0.5) == "rpem-forgetting[forgetting=0.9975]"
    assert with_knob("rpem-drift", 4.0) == "rpem-drift[scale=4]"
    assert with_knob("frozen", 4.0) == "frozen"
    assert with_knob("ekf[noise=0.2]", 4.0) == "ekf[noise=0.2]"
    with pytest.raises(EstimatorError, match=r"no file .*mine\.py"):
        with_knob("mine.py:Mine", 1.0)


def test_an_own_estimator_says_which_option_is_its_knob(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(
        "class Mine:\n    knob = 'gain'\n"
        "    def __init__(self, nominal, period, *, gain=0.2): pass\n"
        "class Wrong(Mine):\n    knob = 'gian'\n",
        encoding="utf-8",
    )
    assert with_knob(f"{path}:Mine", 2.0) == f"{path}:Mine[gain=0.4]"
    with pytest.raises(EstimatorError, match="'gian' is no option"):
        with_knob(f"{path}:Wrong", 2.0)


def test_matching_is_straight_in_the_logarithms():
    # lag = ratio⁻² on this sweep
    points = [point("a", r, r**-2.0) for r in (0.5, 0.8, 1.25, 2.0)] + [point("b", 1.2, 9.0)]
    a, b = matched(points)
    assert a["lag"] == pytest.approx(1.0) and a["over_bound"] == pytest.approx(10.0)
    assert a["lag_interval"] is None  # one seed has none
    ends = [point("c", r, r**-2.0, lag_interval=[r**-2.0 / 2, 3 * r**-2.0]) for r in (0.5, 2.0)]
    assert matched(ends)[0]["lag_interval"] == pytest.approx([0.5, 3.0])
    assert b["lag"] is None  # its sweep does not reach the reference


def test_the_figure_holds_every_estimator_and_the_bound():
    points = [point(e, r, 1 / r) for e in ("a", "b") for r in (0.5, 2.0)]
    labels = figure(points).axes[0].get_legend_handles_labels()[1]
    assert sorted(labels) == ["a", "b", "oracle Cramér–Rao bound"]


def test_the_command(tmp_path, capsys):
    words = ["tradeoff", "kt_step-v1", "--estimator", "rpem-forgetting", "--seeds", "2",
             "--jobs", "1", "-o", str(tmp_path), "--json"]  # fmt: skip
    assert main(words) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["reference"] == "rpem-forgetting[forgetting=0.995]"
    lags = [p["lag"] for p in content["points"]]
    assert len(lags) == 5 and (np.diff(lags) < 0).all()  # faster the more it forgets
    (row,) = content["matched"]
    assert row["lag"] == pytest.approx(lags[2]) and row["over_bound"] > 5
    assert (tmp_path / "tradeoff.svg").exists() and (tmp_path / "tradeoff.json").exists()
