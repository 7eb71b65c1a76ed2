"""Compare at equal noise: the lag of an estimator at that turn of its knob where it is as quiet.

An estimator can be made quicker and noisier, or slower and quieter. So it is run at several
settings of its knob, and read off between the two on either side of the reference's noise, straight
in the logarithms. Which noise: of one fault, the standard deviation of the parameter that changes;
of all faults together, the excess prediction error, which has no units. Where no setting is as
quiet as the reference (or as noisy), the nearest one says what can be said: a bound on one side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import FLOOR, pseudo_values
from flexaxis.experiments.scoring.pooling import scatter
from flexaxis.experiments.scoring.summary import biases_of
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Noise = Literal["std", "excess"]

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
    rows : sequence of mapping
        Rows of scores, one a seed, in the order of the seeds, which all settings share.
    biases : ndarray (n, p)
        Biases of the scenario's `identify` [% of nominal].
    information : ndarray (p, p) or None
        As from `flexaxis.experiments.scoring.excess.information`; the excess error needs both.
    """

    text: str
    factor: float
    rows: Sequence[Mapping[str, Any]]
    biases: Array = field(default_factory=lambda: np.empty((0, 0)))
    information: Array | None = None

    @staticmethod
    def of(
        text: str,
        factor: float,
        runs: Sequence[Sequence[Mapping[str, Any]]],
        parameter: str,
        scenario: Scenario,
    ) -> Setting:
        """Return a setting from the rows of its runs, one for each parameter."""
        rows = [next(row for row in run if row["parameter"] == parameter) for run in runs]
        return Setting(text, factor, rows, biases_of(runs, scenario), information(scenario))

    def array(self, name: str) -> Array:
        """Return a score seed by seed (n,), NaN where it is not defined."""
        values = [row[name] for row in self.rows]
        return np.array([np.nan if value is None else value for value in values], float)

    def noise(self, kind: Noise) -> Callable[[Index], float]:
        """Return the pooled noise of the runs with some indices."""
        if kind == "excess":
            return lambda index: float(np.sqrt(max(0.0, self._excess(index))))
        std, bias = self.array("std"), self.array("bias")
        lost = self.array("lost_before") > 0
        return lambda index: scatter(std[index], bias[index], lost[index])

    def _excess(self, index: Index) -> float:
        each, lost = self.array("excess"), self.array("lost_before") > 0
        if self.information is None:
            return float(each[index].mean())
        return pooling.excess(each[index], lost[index], self.biases[index], self.information)


@dataclass(frozen=True, eq=False)
class Match:
    """An estimator at the noise of the reference.

    Attributes
    ----------
    how : {"matched", "quieter", "noisier"}
        Whether it is as noisy there, or at all its settings quieter, or noisier.
    settings : tuple of str
        The two settings it lies between, or the nearest one.
    ratio : float
        Noise over that of the reference: 1 if matched.
    nearest : Setting
        The setting that is nearest to the match.
    at : callable
        ``at(name)``: ln of a score at the match, seed by seed, as the jackknife's values (n,);
        their mean is the estimate, and those of two estimators are paired. None where it is not
        defined in all runs.
    """

    how: str
    settings: tuple[str, ...]
    ratio: float
    nearest: Setting
    at: Callable[[str], Array | None]

    def false_alarms(self) -> Array | None:
        """Return the false alarms seed by seed (n,) at the nearest setting, None without any."""
        found = [row["detection"] for row in self.nearest.rows]
        return None if None in found else np.array([f["false_alarms"] for f in found], float)


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
    line = sorted(settings, key=lambda s: s.factor)
    noises = [setting.noise(noise) for setting in line]
    zero = reference.noise(noise)
    every = np.arange(len(reference.rows))
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log([of(every) for of in noises]) - np.log(zero(every))
    if not line or np.isnan(logs).any():
        return None
    found = [
        _between(line[k : k + 2], noises[k : k + 2], zero, logs[k : k + 2])
        for k in range(len(line) - 1)
        if np.isfinite(logs[k : k + 2]).all() and logs[k] * logs[k + 1] <= 0
    ]
    if not found:
        return _nearest(line, logs)
    # Where a line crosses more than once, the crossing nearest to the default is meant: the best
    # of them would be the best by luck.
    return min(found, key=lambda m: abs(np.log(m.nearest.factor)))


def _nearest(line: Sequence[Setting], logs: Array) -> Match:
    best = int(np.argmin(abs(logs)))
    how = MATCHED if logs[best] == 0 else QUIETER if logs[best] < 0 else NOISIER
    setting = line[best]
    ratio = float(np.exp(logs[best]))
    return Match(how, (setting.text,), ratio, setting, lambda name: plain(setting, name))


def _between(
    sides: Sequence[Setting],
    noises: Sequence[Callable[[Index], float]],
    zero: Callable[[Index], float],
    logs: Array,
) -> Match:
    """Return the match between two settings, of which one is quieter and one noisier."""

    def share(index: Index) -> float:
        reference = np.log(zero(index))
        low, high = (np.log(of(index)) - reference for of in noises)
        return float(-low / (high - low)) if high != low else 0.5

    nearest = sides[int(np.argmin(abs(logs)))]
    texts = tuple(setting.text for setting in sides)
    return Match(
        MATCHED, texts, 1.0, nearest, lambda name: _interpolated(sides[0], sides[1], share, name)
    )


def log_of(value: float) -> float:
    """Return ln of a score, of those that are all but zero that of the floor."""
    return float(np.log(max(FLOOR, value)))


def _values(setting: Setting, name: str) -> Callable[[Index], float] | None:
    """Return ln of the pooled score of some runs; of scores that are logarithms, themselves."""
    if name in SPREADS:
        std, bias = setting.array(name), setting.array(SPREADS[name][0])
        lost = setting.array(SPREADS[name][1]) > 0
        if np.isnan(std).any():
            return None
        return lambda index: log_of(scatter(std[index], bias[index], lost[index]))
    each = setting.array(name)
    if np.isnan(each).any():
        return None
    if name != "score":
        each = np.log(np.maximum(each, FLOOR))
    return lambda index: float(each[index].mean())


def plain(setting: Setting, name: str) -> Array | None:
    """Return ln of a score at one setting as the jackknife's values (n,), as `Match.at` does."""
    of = _values(setting, name)
    return None if of is None else pseudo_values(of, len(setting.rows))


def _interpolated(
    low: Setting, high: Setting, share: Callable[[Index], float], name: str
) -> Array | None:
    """Return the jackknife's values of a score between two settings.

    How far between is itself measured, on the same runs; the jackknife sees that.
    """
    first, second = _values(low, name), _values(high, name)
    if first is None or second is None:
        return None

    def statistic(index: Index) -> float:
        w = share(index)
        return (1 - w) * first(index) + w * second(index)

    return pseudo_values(statistic, len(low.rows))
