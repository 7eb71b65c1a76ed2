"""Settings found by `flexaxis tune`, from which the registry takes the defaults of knobs."""

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files


@dataclass(frozen=True)
class Tuning:
    """
    A setting, and how it was found.

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
    scenario : str or None
        The fault after which the lag is least, for settings that know what is coming.
    lag : float or None
        That lag [s], on the seeds of the tuning.
    """

    estimator: str
    knob: str
    value: float
    setting: str
    match: str
    ratio: float
    command: str
    scenario: str | None = None
    lag: float | None = None


@lru_cache
def tunings() -> tuple[Tuning, ...]:
    """Return all settings of ``tuned.toml``."""
    text = files("flexaxis.estimators").joinpath("tuned.toml").read_text(encoding="utf-8")
    return tuple(Tuning(**table) for table in tomllib.loads(text)["tuned"])


def tuned(estimator: str, otherwise: float) -> float:
    """Return the value of the knob at matched noise, or another where none is known.

    Parameters
    ----------
    estimator : str
        Its name in the registry.
    otherwise : float
        Where tuning begins that has not been done yet.
    """
    found = (t.value for t in tunings() if t.estimator == estimator and t.scenario is None)
    return next(found, otherwise)
