"""Settings that `flexaxis tune` has found, and the axis that they hold for."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from flexaxis.estimators.models.meaning import moves_as
from flexaxis.estimators.models.model import Model

PERIODS_AGREE = 1e-6  # relative


@dataclass(frozen=True)
class Tuning:
    """
    A setting, how it was found, and on which axis.

    Attributes
    ----------
    estimator, knob : str
    value : float
        Of the knob.
    setting : str
        The estimator with all options that were tuned, as for ``--estimator``.
    match : str
        What is equal there: "excess", the excess prediction error, or the parameter whose
        standard deviation is.
    ratio : float
        That noise over that of `rpem-forgetting` at λ = 0.995, on the nominal axis; of the excess
        error the root.
    command : str
        What found it.
    model : str
        The axis by name, as in `known` of `flexaxis.estimators.models.axes.MODELS`.
    identify : tuple of str
        What was estimated.
    period : float
        Sampling period [s].
    noise : float
        Standard deviation of the output [rad/s]. Estimators are not told it: a setting is applied
        whatever it is.
    """

    estimator: str
    knob: str
    value: float
    setting: str
    match: str
    ratio: float
    command: str
    model: str
    identify: Sequence[str]
    period: float
    noise: float

    def holds_for(self, model: Model, period: float, identify: Sequence[str]) -> bool:
        """
        Return whether it was found for this axis, whatever its units.

        Parameters
        ----------
        model : Model
            With the nominal values that the estimator is told, and starts from.
        period : float
            Sampling period [s].
        identify : sequence of str
            What is to be estimated, in any order.
        """
        return (
            sorted(self.identify) == sorted(identify)
            and abs(period / self.period - 1) < PERIODS_AGREE
            and moves_as(model, self.model)
        )


@lru_cache
def tunings() -> tuple[Tuning, ...]:
    """Return all settings of ``tuned.toml``."""
    text = files("flexaxis.estimators").joinpath("tuned.toml").read_text(encoding="utf-8")
    return tuple(Tuning(**table) for table in tomllib.loads(text)["tuned"])


def at_equal_noise(estimator: str) -> Tuning | None:
    """Return the setting of an estimator at matched noise, on the axis that is in it."""
    return next((t for t in tunings() if t.estimator == estimator), None)
