"""The error raised for incorrect use of estimators and models."""

from collections.abc import Iterable
from difflib import get_close_matches


class EstimatorError(ValueError):
    """Incorrect use of an estimator or a model; the error message states what is allowed."""


def did_you_mean(word: str, allowed: Iterable[str]) -> str:
    """
    Return the end of an error message: the closest allowed word and a list of all allowed words.

    Parameters
    ----------
    word : str
        The unknown word.
    allowed : iterable of str
        All words that are allowed instead of ``word``.

    Returns
    -------
    str
        End of the error message, such as ``"did you mean 'f_m'? Allowed: f_m, k_T"``.
    """
    allowed = list(allowed)
    near = get_close_matches(word, allowed, n=1, cutoff=0.5)
    guess = f"did you mean {near[0]!r}? " if near else ""
    return f"{guess}Allowed: {', '.join(allowed)}"
