"""All that `flexaxis speed` times side by side."""

from __future__ import annotations

from collections.abc import Sequence

from flexaxis.experiments.speed.peers import peers
from flexaxis.experiments.speed.plants import plants
from flexaxis.experiments.speed.problem import problem
from flexaxis.experiments.speed.rivals import rivals
from flexaxis.experiments.speed.rounds import Contender
from flexaxis.experiments.speed.shipped import shipped


def contenders(estimators: Sequence[str] = ()) -> tuple[list[Contender], dict[str, str]]:
    """Return what is timed, and which peers are not installed, with what was missing.

    Parameters
    ----------
    estimators : sequence of str
        Of those that are shipped; all by default.
    """
    given = problem()
    others, missing = peers(given)
    return [*rivals(given), *others, *shipped(given, estimators), *plants(given)], missing
