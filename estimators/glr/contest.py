"""Which of two filters beside each other predicts better, whose models of friction differ."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.noise import MEMORY

Array = NDArray[np.float64]

TOGETHER = 64  # samples that are taken before they are looked at
LEAD = 20.0  # nats by which one must predict better than the other to go on alone, as for a shape
SHAPED = 3.0  # times that for who has to take the place of one that has taken up a shape already
LONGEST = 2.0  # times the memory of the noise, or the first seconds if they are longer, after which
# the first goes on: by then each knows the noise that its model leaves


class Contest:
    """
    The sums of innovations e of two filters, whose variances S are right but for a factor.

    They have the likelihood −½ [Σ ln S + n ln Σ e²/S] in n samples, none of which the filter has
    seen: what it has more to learn costs what it predicts worse for that, and nothing else.

    Parameters
    ----------
    first : int
        Samples of the first seconds.
    period : float
        Sampling period [s].

    Attributes
    ----------
    won : bool
        Whether the second goes on.
    over : bool
    """

    def __init__(self, first: int, period: float) -> None:
        self._most, self._all, self._used = max(first, LONGEST * MEMORY / period), 0, 0
        self._log, self._square = np.zeros(2), np.zeros(2)
        self.won, self.over, self._begun = False, False, False

    @property
    def wanted(self) -> int:
        """How many samples there are until somebody has to look."""
        return TOGETHER - self._all % TOGETHER

    def take(self, ours: Array, theirs: Array, *, awake: bool, shaped: bool) -> None:
        """
        Take what each has predicted.

        Parameters
        ----------
        ours, theirs : (N, 3) arrays
            ŷ, innovation and its variance; NaN in a gap.
        awake : bool
            Whether both have learnt the structure of the axis.
        shaped : bool
            Whether the first has taken up a shape.
        """
        self._all += len(ours)
        _, e, S = np.stack([ours, theirs]).transpose(2, 0, 1)
        used = np.isfinite(e).all(axis=0) & (S > 0).all(axis=0) & self._begun
        self._log += np.log(S[:, used]).sum(axis=1)
        self._square += (e[:, used] ** 2 / S[:, used]).sum(axis=1)
        self._used += int(used.sum())
        if self._all % TOGETHER:
            return
        self._begun = awake  # one that begins anew learns once more
        if self._used:
            first, second = 0.5 * (
                self._log + self._used * np.log(np.maximum(self._square, 1e-300))
            )
            self.won = bool(first - second > LEAD * (SHAPED if shaped else 1.0))
            lost = bool(second - first > LEAD) and not shaped  # which is worth another look
            self.over = self.won or lost or self._used > self._most
