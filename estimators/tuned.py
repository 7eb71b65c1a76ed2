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
    A tuned setting, the command that found it, and its axis.

    Attributes
    ----------
    estimator, knob : str
    value : float
        Of the knob.
    setting : str
        The estimator with the tuned option, as for ``--estimator``.
    match : str
        The measure of noise that was matched: "excess", the excess prediction error, or the name of
        a parameter, for its standard deviation.
    ratio : float
        Its noise over that of `rpem-forgetting` at λ = 0.995, on the nominal axis; for the excess
        error the square root of the ratio.
    command : str
        Command that found it.
    model : str
        The axis by name: ``"n1"``.
    identify : tuple of str
        Identified parameters.
    period : float
        Sampling period [s].
    noise : float
        Standard deviation of the output [rad/s]. A setting is applied at any noise.
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
        Return whether it was found for this axis, in any units.

        Parameters
        ----------
        model : Model
            With the nominal values from which the estimator starts.
        period : float
            Sampling period [s].
        identify : sequence of str
            Parameters to identify, in any order.
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
    """Return the tuned setting of an estimator, None if there is none."""
    return next((t for t in tunings() if t.estimator == estimator), None)
