"""The error that estimators raise when they are given something they cannot use."""

from collections.abc import Iterable
from difflib import get_close_matches


class EstimatorError(ValueError):
    """Wrong use of an estimator or a model: what was given, what is allowed, what to do."""


def did_you_mean(word: str, allowed: Iterable[str]) -> str:
    """
    Say which of the allowed words is nearest, and which there are.

    Parameters
    ----------
    word : str
        What was given.
    allowed : iterable of str
        What would have been accepted.

    Returns
    -------
    str
        End of a sentence, such as ``"did you mean 'f_m'? Allowed: f_m, k_T"``.
    """
    allowed = list(allowed)
    near = get_close_matches(word, allowed, n=1, cutoff=0.5)
    guess = f"did you mean {near[0]!r}? " if near else ""
    return f"{guess}Allowed: {', '.join(allowed)}"
