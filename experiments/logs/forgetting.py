"""A forgetting factor for the rate of a log, given as a time or as it is."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from flexaxis.experiments.building.specs import Spec, parse
from flexaxis.experiments.logs.errors import LogError

_FORGETTING = re.compile(r"\s*(?P<value>[0-9.]+(e-?[0-9]+)?)\s*(?P<unit>ms|s|min)?\s*")
_SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0}


def with_forgetting(spec: Spec, text: str, period: float) -> Spec:
    """Return an estimator with a forgetting factor, given as λ or as a time constant.

    Parameters
    ----------
    spec : Spec
    text : str
        ``"0.995"``, or a time such as ``"1 s"`` or ``"500 ms"``: λ = 1 − T/τ, the memory of
        samples T apart fades by 1/e in τ.
    period : float
        [s].

    Raises
    ------
    LogError
        If it is neither, or not possible.
    EstimatorError
        If the estimator forgets in no such way.
    """
    match = _FORGETTING.fullmatch(text)
    value = float(match["value"]) if match else np.nan
    unit = match["unit"] if match else None
    if unit:
        value = 1 - period / (value * _SECONDS[unit]) if value else np.nan
    if not 0 < value < 1:
        raise LogError(
            f"--forgetting {text!r}: give a time such as '1 s', longer than the sampling period of "
            f"{1e3 * period:g} ms, or a factor between 0 and 1 such as 0.995"
        )
    parse(f"{spec.text.partition('[')[0]}[forgetting={value!r}]")  # refuses who has no such option
    return replace(spec, options=dict(spec.options) | {"forgetting": value})
