"""Compare estimators at equal noise by interpolation between two settings of a tuning parameter.

One of the two settings makes the estimator less noisy than a reference estimator, and the other
setting makes it noisier. The logarithm of the lag is interpolated linearly as a function of the
logarithm of the noise. If no setting is as noisy (or as quiet) as the reference, the lag at the
nearest setting is only a one-sided bound on the lag at equal noise.
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
"""For each score that is a standard deviation, the names of two related scores: the mean error over
the evaluated samples, and whether the run diverged before the last evaluated sample."""


@dataclass(frozen=True, eq=False)
class Setting:
    """Scores of an estimator at one setting of its tuning parameter, for one fault.

    Attributes
    ----------
    text : str
        Estimator, in the format of the option `--estimator`.
    factor : float
        Setting of the tuning parameter, divided by the default setting.
    rows : DataFrame
        Scores of the faulty parameter, with one row per seed, sorted by seed. All settings of an
        estimator are run with the same seeds.
    biases : ndarray (n, p)
        Estimation biases of all identified parameters [% of nominal], with one row per run.
    information : ndarray (p, p) or None
        Matrix M of the excess error θ̃ᵀMθ̃, from `flexaxis.experiments.scoring.excess.information`.
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
        """Create a `Setting` from a table of scores with one row per seed and parameter."""
        wide = frame.pivot(index="seed", columns="parameter", values="bias")
        biases = wide.reindex(columns=list(scenario.identify)).fillna(0.0).to_numpy(float)
        rows = frame[frame["parameter"] == parameter].sort_values("seed")
        return Setting(text, factor, rows, biases, information(scenario))

    def array(self, name: str, runs: Any = slice(None)) -> Array:
        """Return the values of a score, one per run (n,); undefined values are NaN."""
        return self.rows[name].to_numpy(float)[runs]

    def log(self, name: str, runs: Any = slice(None)) -> float:
        """Return the logarithm of a pooled score, or NaN if the score is undefined in any run.

        For the excess error, the method returns the logarithm of the square root of the pooled
        excess error. The score named `score` is already the lag on a logarithmic scale, so the
        method returns its mean.
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
        """Return jackknife pseudo-values (n,) of a score's logarithm, or None if undefined."""
        if np.isnan(self.array(name)).any():
            return None
        return pseudo_values(lambda runs: self.log(name, runs), len(self.rows))


@dataclass(frozen=True, eq=False)
class Match:
    """A match between the noise of an estimator and the noise of a reference estimator.

    Attributes
    ----------
    how : {"matched", "quieter", "noisier"}
        `how` is "matched" if the reference noise lies between the noise levels at two settings.
        `how` is "quieter" if the estimator is less noisy than the reference at all settings. `how`
        is "noisier" if the estimator is noisier than the reference at all settings.
    sides : tuple of Setting
        The two settings with noise just below and just above the reference noise, or the single
        setting whose noise is closest to the reference noise.
    reference : Setting
        Setting of the reference estimator.
    kind : {"std", "excess"}
        Measure of the noise.
    """

    how: str
    sides: tuple[Setting, ...]
    reference: Setting
    kind: Noise

    def apart(self, side: Setting, runs: Any = slice(None)) -> float:
        """Return the log-ratio of the noise at a setting to the reference noise."""
        return side.log(self.kind, runs) - self.reference.log(self.kind, runs)

    @property
    def nearest(self) -> Setting:
        """The setting whose noise is closest to the reference noise."""
        return min(self.sides, key=lambda side: abs(self.apart(side)))

    @property
    def ratio(self) -> float:
        """Estimator noise divided by the reference noise; 1 if the noise is matched."""
        return 1.0 if self.how == MATCHED else float(np.exp(self.apart(self.nearest)))

    def at(self, name: str) -> Array | None:
        """Return jackknife pseudo-values (n,) of a score's logarithm at the reference noise.

        There is one pseudo-value per seed, and their mean estimates the logarithm. Pseudo-values of
        two estimators for the same seed form a pair. The interpolation point between the two
        settings depends on the noise in the runs. The jackknife recomputes this point, and
        therefore includes its uncertainty. The method returns None if the score is undefined in any
        run.
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
    """Match the noise of an estimator to the noise of a reference estimator.

    Parameters
    ----------
    reference : Setting
        Setting of the reference estimator.
    settings : sequence of Setting
        Settings of one estimator.
    noise : {"std", "excess"}
        Measure of the noise.

    Returns
    -------
    Match or None
        The result is None if the reference estimates contain no noise, if `settings` is empty, or
        if the noise at any setting is undefined.
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
    if crossings:  # choose the one nearest to the default, because the best lag would be biased
        return min(crossings, key=lambda m: abs(np.log(m.nearest.factor)))
    best = int(np.argmin(abs(logs - target)))
    how = MATCHED if logs[best] == target else QUIETER if logs[best] < target else NOISIER
    return Match(how, (line[best],), reference, noise)
