"""What acted in the gaps of a log: a torque that leads to what was measured behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from flexaxis.estimators.offline.delay import delayed
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.identification.log import Log, gaps, unknowns
from flexaxis.experiments.logs.identification.setup import SETTLING, Setup

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LONG = 4  # samples for each cosine


def filled(log: Log, axis: Axis, there: Flags) -> Log:
    """Return a log with a torque in its gaps by which the axis comes to what is measured behind.

    A line may lead elsewhere, and who follows the axis sample by sample would see a change there.
    At the end of a gap it is a sum of cosines: of one more than there are states, for an increment
    tells of the sample before, any state is reached. Of many gaps they are fewer. What was known,
    or is behind a high-pass, stays.
    """
    if log.known or axis.highpass is not None:
        return log
    rows, most, room = list[Array](), len(axis.model.states) + 1, unknowns(len(log.u))
    missing = sorted(gaps(there), key=lambda gap: gap[0] - gap[1])[:room]
    for begin, end in missing:
        length = min(end - begin, LONG * most)
        shapes = dct(np.eye(length), axis=1, norm="ortho").T
        for row in shapes[: min(most, room // len(missing))]:
            rows.append(np.zeros(len(log.u)))
            rows[-1][end - length : end] = row
    if not rows:
        return log
    late = axis.delay / log.period
    acts = np.array([delayed(row, late, smooth=log.smooth) for row in rows])
    setup = Setup(log, axis.model, axis.model.parameters[:1])
    along = setup.course(log.begins(0, 0), acts)
    z = np.zeros(along.q)
    z[:1], z[-2:] = axis.model.parametrize(setup.names).theta, (axis.offset, axis.delay)
    unknown, ok = slice(1, along.q - 2), there.copy()
    ok[: along.begins[0] + 1] = False
    for _ in range(SETTLING):
        simulated, slopes = along.along(z)
        if not np.isfinite(slopes).all():
            return log
        J, e = slopes[unknown][:, ok].T, (log.y - simulated)[ok]
        z[unknown] += np.linalg.lstsq(J, e, rcond=None)[0]
    return replace(log, u=log.u + z[1 : 1 + len(rows)] @ np.array(rows))
