"""Estimators at equal noise: the lag between two settings of a tuning parameter.

The lag is interpolated, linearly in the logarithms, between the two settings on either side of the
noise of a reference. Where no setting is as quiet as the reference (or as noisy), the nearest one
gives a bound on one side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.comparison.ranking import MATCHED, NOISIER, QUIETER
from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import FLOOR, pseudo_values
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Noise = Literal["std", "excess"]
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

    def array(self, name: str, runs: Any = slice(None)) -> Array:
        """Return a score run by run (n,), NaN where it is not defined."""
        return self.rows[name].to_numpy(float)[runs]

    def log(self, name: str, runs: Any = slice(None)) -> float:
        """Return ln of a pooled score; NaN where a run has none.

        Of the excess error it is that of the root; a `score` is a logarithm already.
        """
        each = self.array(name, runs)
        if name == "score" or np.isnan(each).any():
            return float(each.mean())
        if name in SPREADS:
            bias, lost = (self.array(beside, runs) for beside in SPREADS[name])
            each = np.array([pooling.spread(each, bias, lost > 0)])
        if name == "excess" and self.information is not None:
            lost = self.array("lost_before", runs) > 0  # type: ignore[assignment]
            whole = pooling.excess(each, lost, self.biases[runs], self.information)  # type: ignore[arg-type]
            each = np.sqrt([max(0.0, whole)])
        return float(np.log(np.maximum(each, FLOOR)).mean())

    def at(self, name: str) -> Array | None:
        """Return ln of a score as the jackknife's values (n,), None where a run has none."""
        if np.isnan(self.array(name)).any():
            return None
        return pseudo_values(lambda runs: self.log(name, runs), len(self.rows))


@dataclass(frozen=True, eq=False)
class Match:
    """An estimator at the noise of the reference.

    Attributes
    ----------
    how : {"matched", "quieter", "noisier"}
        Whether it is as noisy, or at all its settings quieter, or noisier.
    sides : tuple of Setting
        The two settings it lies between, or the nearest one.
    reference : Setting
    kind : {"std", "excess"}
        Which noise.
    """

    how: str
    sides: tuple[Setting, ...]
    reference: Setting
    kind: Noise

    def apart(self, side: Setting, runs: Any = slice(None)) -> float:
        """Return ln of the noise of a setting over that of the reference."""
        return side.log(self.kind, runs) - self.reference.log(self.kind, runs)

    @property
    def nearest(self) -> Setting:
        """The setting whose noise is nearest to that of the reference."""
        return min(self.sides, key=lambda side: abs(self.apart(side)))

    @property
    def ratio(self) -> float:
        """Noise over that of the reference: 1 if matched."""
        return 1.0 if self.how == MATCHED else float(np.exp(self.apart(self.nearest)))

    def at(self, name: str) -> Array | None:
        """Return ln of a score at the match, seed by seed, as the jackknife's values (n,).

        Their mean is the estimate, and those of two estimators are paired. How far between the two
        settings the match lies is itself measured on the same runs; the jackknife includes that.
        None where a run has no such score.
        """

        def statistic(runs: Any) -> float:
            values = [side.log(name, runs) for side in self.sides]
            low, high = self.apart(self.sides[0], runs), self.apart(self.sides[-1], runs)
            share = -low / (high - low) if high != low else 0.5
            return (1 - share) * values[0] + share * values[-1]

        if any(np.isnan(side.array(name)).any() for side in self.sides):
            return None
        if len(self.sides) == 1:
            return self.sides[0].at(name)
        return pseudo_values(statistic, len(self.reference.rows))


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
    none, target = np.log(FLOOR), reference.log(noise)
    logs = np.array([setting.log(noise) for setting in line])
    if not line or np.isnan(logs).any() or not target > none:
        return None
    crossings = [
        Match(MATCHED, tuple(line[k : k + 2]), reference, noise)
        for k, (one, other) in enumerate(pairwise(logs))
        if min(one, other) > none and (one - target) * (other - target) <= 0
    ]
    if crossings:  # the one nearest to the default: the best would be the best by luck
        return min(crossings, key=lambda m: abs(np.log(m.nearest.factor)))
    best = int(np.argmin(abs(logs - target)))
    how = MATCHED if logs[best] == target else QUIETER if logs[best] < target else NOISIER
    return Match(how, (line[best],), reference, noise)
