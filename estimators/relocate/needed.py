"""
Which parameters the data ask for: those that they do not contradict stay as they were told.

Of a parameter one may hold that it is what the data sheet says, or that it is anything of about
that size; of a law, that the axis has it not. With a normal prior and a normal posterior the first
is the likelier by p(told | data)/p(told), the ratio of the densities there (J. M. Dickey, *The
weighted likelihood ratio, linear hypotheses on normal location parameters*, Ann. Math. Stat. 42,
1971). What the excitation cannot see has a ratio of one, and stays as it is told.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.work import CALL, Work, finished

Array = NDArray[np.float64]
Places = NDArray[np.int64]


TRUST = 3.0  # nats, by which what is told is likelier before any data


class Question(NamedTuple):
    """
    Parameters that may all be as told.

    Attributes
    ----------
    places : (g,) int array
    told : (g,) array
        What they are told to be.
    with_them : (h,) int array
        Further ones that mean nothing then.
    """

    places: Places
    told: Array
    with_them: Places


class Posterior(NamedTuple):
    """Parameters (m,) in use, their most probable values (m,), precision (m, m), by places."""

    active: Places
    theta: Array
    H: Array

    def conditioned(self, fixed: Places, values: Array) -> "Posterior":
        """Return what is known of the others where some are given."""
        mine = np.isin(self.active, fixed)
        rest = ~mine
        order = [list(fixed).index(i) for i in self.active[mine]]
        off = values[order] - self.theta[mine]
        H = self.H[np.ix_(rest, rest)]
        moved = np.linalg.solve(H, self.H[np.ix_(rest, mine)] @ off)
        return Posterior(self.active[rest], self.theta[rest] - moved, H)


def needed(
    posterior: Posterior,
    questions: Sequence[Question],
    *,
    mean: Array,
    deviation: Array,
    unseen: Sequence[Question] = (),
) -> tuple[Posterior, list[tuple[Places, Array]]]:
    """
    Fix all that the data do not ask for, the likeliest first; return what is left and what fixed.

    Parameters
    ----------
    posterior : Posterior
        With all parameters in use; its precision contains that of the prior.
    questions : sequence of Question
    mean, deviation : (p,) arrays
        Of the prior of each parameter.
    unseen : sequence of Question
        Those of what the data do not show, which are not asked: these are as told.
    """
    return finished(asking(posterior, questions, mean=mean, deviation=deviation, unseen=unseen))


def asking(
    posterior: Posterior,
    questions: Sequence[Question],
    *,
    mean: Array,
    deviation: Array,
    unseen: Sequence[Question] = (),
) -> Work[tuple[Posterior, list[tuple[Places, Array]]]]:
    """Do as `needed`, in pieces of one round of questions."""
    yield CALL * (1 + len(unseen))
    left: list[Question] = list(questions)
    fixed: list[tuple[Places, Array]] = []
    for question in unseen:
        posterior = _fix(posterior, question, mean, fixed)
    left = [q for q in left if np.isin(q.places, posterior.active).all()]
    while left:
        yield CALL * (2 + len(left))
        weights: list[float] = [
            weight(posterior, q, mean[q.places], deviation[q.places]) for q in left
        ]
        best = int(np.argmax(weights))
        if not weights[best] >= -TRUST:
            break
        posterior = _fix(posterior, left.pop(best), mean, fixed)
        left = [q for q in left if np.isin(q.places, posterior.active).all()]
    return posterior, fixed


def _fix(
    posterior: Posterior, question: Question, mean: Array, fixed: list[tuple[Places, Array]]
) -> Posterior:
    """Return what is left where the answer is yes; note what is fixed."""
    gone = np.r_[question.places, question.with_them]
    values = np.r_[question.told, mean[question.with_them]]
    there = np.isin(gone, posterior.active)
    fixed.append((gone[there], values[there]))
    return posterior.conditioned(gone[there], values[there])


def weight(posterior: Posterior, question: Question, mean: Array, deviation: Array) -> float:
    """Return the logarithm of the ratio of the densities [nats]."""
    mine = [list(posterior.active).index(i) for i in question.places]
    C = np.linalg.inv(posterior.H)[np.ix_(mine, mine)]
    off = question.told - posterior.theta[mine]
    after = -(off @ np.linalg.solve(C, off) + np.linalg.slogdet(C)[1]) / 2
    apart = (question.told - mean) / deviation
    return float(after + (apart @ apart) / 2 + np.sum(np.log(deviation)))
