"""Matching at equal noise, the sweep over knobs, and its command."""

import numpy as np
import pandas as pd
import pytest
from engine_cases import runner_here

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.comparison.sweep import Setting, match, sweep, with_knob
from flexaxis.experiments.scoring.intervals import mean_interval

COMMON = np.random.default_rng(0).standard_normal(12)


def setting(factor, *, std=1.0, lag=1.0, excess=1e-2, lost=0, text="e"):
    """Twelve runs of an estimator; what the record does is common to all settings."""
    rows = [
        {
            "lag": lag * np.exp(0.2 * c), "std": std * np.exp(0.1 * c), "bias": 0.0,
            "std_after": std, "bias_after": 0.0, "excess": excess, "score": 50.0 - c,
            "diverged": i < lost, "lost_before": i < lost, "lost_after": i < lost,
            "detection": None,
        }
        for i, c in enumerate(COMMON)
    ]  # fmt: skip
    return Setting(f"{text}[{factor}]", factor, pd.DataFrame(rows))


def line(factors, *, lag=1.0, noise=1.0):
    """lag = lag·factor⁻², std = noise·factor."""
    return [setting(f, std=noise * f, lag=lag * f**-2.0, excess=1e-2 * f**2) for f in factors]


def texts_of(found):
    return [side.text for side in found.sides]


def lag_of(found):
    return np.exp(found.at("lag").mean())


def geometric(lag):
    return lag * np.exp(0.2 * COMMON.mean())


def test_knobs():
    assert with_knob("rpem-forgetting", 0.5) == "rpem-forgetting[forgetting=0.9975]"
    assert with_knob("rpem-drift", 4.0) == "rpem-drift[scale=4]"
    assert with_knob("frozen", 4.0) == "frozen"
    assert with_knob("ekf[noise=0.2]", 4.0) == "ekf[noise=0.2]"
    assert with_knob("rpem-forgetting", 256) is None  # λ would be below zero
    with pytest.raises(EstimatorError, match=r"estimator file mine\.py does not exist"):
        with_knob("mine.py:Mine", 1.0)


def test_matching_is_straight_in_the_logarithms():
    found = match(setting(1.0), line([0.25, 0.5, 2.0, 4.0]), "std")
    assert found.how == "matched" and texts_of(found) == ["e[0.5]", "e[2.0]"]
    assert lag_of(found) == pytest.approx(geometric(1.0))
    assert np.exp(found.at("std_after").mean()) == pytest.approx(1.0)
    # a setting that is exactly as noisy is the match
    exact = match(setting(1.0), line([0.5, 1.0, 2.0]), "std")
    assert lag_of(exact) == pytest.approx(geometric(1.0))


def test_of_several_crossings_the_nearest_to_the_default_counts():
    """The best of them would be the best by luck."""
    stds = {0.125: 0.5, 0.25: 2.0, 1.0: 0.5, 2.0: 2.0}
    crossing = [setting(f, std=s, lag=1 / f) for f, s in stds.items()]
    found = match(setting(1.0), crossing, "std")
    assert texts_of(found) == ["e[1.0]", "e[2.0]"] or found.nearest.factor == 1.0


def test_out_of_reach_is_said_on_one_side():
    quiet = match(setting(1.0), line([0.25, 0.5]), "std")
    assert (quiet.how, texts_of(quiet)) == ("quieter", ["e[0.5]"])
    assert quiet.ratio == pytest.approx(0.5) and lag_of(quiet) == pytest.approx(geometric(4.0))
    loud = match(setting(1.0), line([2.0, 4.0]), "std")
    assert loud.how == "noisier" and loud.ratio == pytest.approx(2.0)
    still = match(setting(1.0), [setting(1.0, std=0.0, lag=5.0)], "std")
    assert still.how == "quieter" and still.ratio < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("n", [8, 16])
def test_the_interval_counts_how_well_the_match_itself_is_known(n):
    """Lag and noise of a run hang together; the match between two settings trades them."""
    rng, found = np.random.default_rng(n), []
    for _ in range(200):
        own, other = rng.standard_normal((2, n))
        drawn = rng.standard_normal((2, n))  # some of the noise is slower than the window
        made = []
        for factor in (0.5, 2.0):
            rows = [
                {"lag": factor**-2.0, "std": factor * np.hypot(np.exp(0.2 * c), 0.3 * b),
                 "bias": 0.3 * factor * b, "lost_before": False, "diverged": False}
                for c, b in zip(own, drawn[0], strict=True)
            ]  # fmt: skip
            made.append(Setting("e", factor, pd.DataFrame(rows)))
        rows = [
            {"std": np.hypot(np.exp(0.2 * c), 0.3 * b), "bias": 0.3 * b, "lost_before": False}
            for c, b in zip(other, drawn[1], strict=True)
        ]
        low, high = mean_interval(
            match(Setting("r", 1.0, pd.DataFrame(rows)), made, "std").at("lag")
        )
        found.append(low <= 0.0 <= high)
    assert 0.90 <= np.mean(found) <= 0.99  # 95 %, three binomial deviations of 200


class Timid:
    """Follows f_m by a filter far slower than the reference, unless its gain is turned up."""

    names, output, knob = ("f_m",), "speed", "gain"

    def __init__(self, nominal, period, *, gain=1e-7):
        self.theta, self.gain, self.y = nominal["f_m"], gain, 0.0

    def step(self, u, y):
        noise = 0.0 if y is None else y - self.y
        self.theta += self.gain * noise
        self.y += noise
        return [self.theta]


@pytest.mark.slow
def test_a_sweep_that_does_not_reach_is_widened(short):
    own = f"{__file__}:Timid"
    found = sweep([short], [own], [0, 1, 2], runner_here().rows)
    factors = {p["factor"] for p in found.points}
    assert {16.0, 64.0} <= factors  # its noise at the default is a thousandth of the reference's
    (mine,) = found.matched
    assert mine["how"] in ("matched", "quieter")
