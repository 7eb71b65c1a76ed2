"""Compare at equal noise: the lag of an estimator at that turn of its knob where it is as quiet.

An estimator can be made quicker and noisier, or slower and quieter. So it is run at several
settings of its knob, and read off between the two on either side of the noise of the reference,
linearly in the logarithms. For one fault the noise is the standard deviation of the parameter that
changes; for all faults together it is the excess prediction error, which has no units. Where no
setting is as quiet as the reference (or as noisy), the nearest one gives a bound on one side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import FLOOR, pseudo_values
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Noise = Literal["std", "excess"]
Run = Callable[[Sequence[Scenario], Sequence[str], Sequence[int]], pd.DataFrame]
"""``run(scenarios, estimators, seeds)``: the rows of these cases, as `Runner.rows` returns them."""

MATCHED, QUIETER, NOISIER = "matched", "quieter", "noisier"
SPREADS = {"std": ("bias", "lost_before"), "std_after": ("bias_after", "lost_after")}
"""Standard deviations, with the score of their mean and the one that says a run was lost."""


@dataclass(frozen=True, eq=False)
class Setting:
    """One estimator at one setting of its knob, on one scenario, for one parameter.

    Attributes
    ----------
    text : str
        As for `--estimator`.
    factor : float
        Turn of the knob, 1 for the default.
    rows : DataFrame
        Rows of scores, one a seed, in the order of the seeds, which all settings share.
    biases : ndarray (n, p)
        Biases of the scenario's `identify` [% of nominal].
    information : ndarray (p, p) or None
        As from `flexaxis.experiments.scoring.excess.information`; the excess error needs both.
    """

    text: str
    factor: float
    rows: pd.DataFrame
    biases: Array = field(default_factory=lambda: np.empty((0, 0)))
    information: Array | None = None

    @staticmethod
    def of(
        text: str, factor: float, frame: pd.DataFrame, parameter: str, scenario: Scenario
    ) -> Setting:
        """Return a setting from the rows of its runs, one a seed and parameter."""
        wide = frame.pivot(index="seed", columns="parameter", values="bias")
        biases = wide.reindex(columns=list(scenario.identify)).fillna(0.0).to_numpy(float)
        rows = frame[frame["parameter"] == parameter].sort_values("seed")
        return Setting(text, factor, rows, biases, information(scenario))

    def array(self, name: str) -> Array:
        """Return a score seed by seed (n,), NaN where it is not defined."""
        return self.rows[name].to_numpy(float)

    def noise(self, kind: Noise, runs: Any = slice(None)) -> float:
        """Return the pooled noise, of some runs only if their indices are given."""
        lost = self.array("lost_before")[runs] > 0
        if kind == "std":
            return pooling.scatter(self.array("std")[runs], self.array("bias")[runs], lost)
        each = self.array("excess")[runs]
        if self.information is None:
            return float(np.sqrt(each.mean()))
        excess = pooling.excess(each, lost, self.biases[runs], self.information)
        return float(np.sqrt(np.maximum(0.0, excess)))

    def log(self, name: str, runs: Any = slice(None)) -> float:
        """Return ln of a pooled score; NaN where a run has none. A `score` is a logarithm."""
        each = self.array(name)[runs]
        if name in SPREADS and not np.isnan(each).any():
            bias, lost = (self.array(beside)[runs] for beside in SPREADS[name])
            return log_of(pooling.scatter(each, bias, lost > 0))
        return float((each if name == "score" else np.log(np.maximum(each, FLOOR))).mean())


def log_of(value: float) -> float:
    """Return ln of a score, at least that of the floor."""
    return float(np.log(max(FLOOR, value)))


@dataclass(frozen=True, eq=False)
class Match:
    """An estimator at the noise of the reference.

    Attributes
    ----------
    how : {"matched", "quieter", "noisier"}
        Whether it is as noisy, or at all its settings quieter, or noisier.
    sides : tuple of Setting
        The two settings it lies between, or the nearest one.
    ratio : float
        Noise over that of the reference: 1 if matched.
    reference : Setting
    kind : {"std", "excess"}
        Which noise.
    """

    how: str
    sides: tuple[Setting, ...]
    ratio: float
    reference: Setting
    kind: Noise

    @property
    def nearest(self) -> Setting:
        """The setting whose noise is nearest to that of the reference."""
        return min(self.sides, key=lambda side: abs(_log_ratio(side, self.reference, self.kind)))

    def at(self, name: str) -> Array | None:
        """Return ln of a score at the match, seed by seed, as the jackknife's values (n,).

        Their mean is the estimate, and those of two estimators are paired. How far between the two
        settings the match lies is itself measured on the same runs; the jackknife includes that.
        None where a run has no such score.
        """

        def statistic(runs: Any) -> float:
            values = [side.log(name, runs) for side in self.sides]
            if len(values) == 1:
                return values[0]
            low, high = (_log_ratio(s, self.reference, self.kind, runs) for s in self.sides)
            share = -low / (high - low) if high != low else 0.5
            return (1 - share) * values[0] + share * values[1]

        if any(np.isnan(side.array(name)).any() for side in self.sides):
            return None
        return pseudo_values(statistic, len(self.reference.rows))

    def false_alarms(self) -> Array | None:
        """Return the false alarms seed by seed (n,) at the nearest setting, None without any."""
        rows = self.nearest.rows
        if "detection.false_alarms" not in rows or rows["detection.false_alarms"].isna().any():
            return None
        return rows["detection.false_alarms"].to_numpy(float)


def plain(setting: Setting, name: str) -> Array | None:
    """Return ln of a score at one setting, as `Match.at` does."""
    return Match(MATCHED, (setting,), 1.0, setting, "std").at(name)


def match(reference: Setting, settings: Sequence[Setting], noise: Noise) -> Match | None:
    """Return an estimator at the noise of a reference.

    Parameters
    ----------
    reference : Setting
    settings : sequence of Setting
        Of one estimator.
    noise : {"std", "excess"}
        What is to be equal.

    Returns
    -------
    Match or None
        None where the reference has no noise, or the estimator no settings with any.
    """
    line = sorted(settings, key=lambda setting: setting.factor)
    logs = np.array([_log_ratio(setting, reference, noise) for setting in line])
    if not line or np.isnan(logs).any():
        return None
    crossings = [
        Match(MATCHED, tuple(line[k : k + 2]), 1.0, reference, noise)
        for k in range(len(line) - 1)
        if np.isfinite(logs[k : k + 2]).all() and logs[k] * logs[k + 1] <= 0
    ]
    if crossings:  # the one nearest to the default: the best would be the best by luck
        return min(crossings, key=lambda m: abs(np.log(m.nearest.factor)))
    best = int(np.argmin(abs(logs)))
    how = MATCHED if logs[best] == 0 else QUIETER if logs[best] < 0 else NOISIER
    return Match(how, (line[best],), float(np.exp(logs[best])), reference, noise)


def _log_ratio(side: Setting, reference: Setting, kind: Noise, runs: Any = slice(None)) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        both = np.log([side.noise(kind, runs), reference.noise(kind, runs)])
        return float(both[0] - both[1])
