"""Which logs of a trend are not like the others: fitted worse, late, or not fitted to the end.

The thresholds were judged by `tests/experiments/log_health_tables.py`: 40 sets of 20 logs of one
and two masses at 200 to 4000 Hz, of 3 and 12 s, with noise of 2 and 30 % of the speed, friction
that falls by 10 % over a set, and an axis known to 3 %. None of 800 good logs was said to be bad.
Of logs with 2 % of noise, all were found that were half a sample late, vibrated by 15 % or had dry
friction of a tenth of the torque. With 30 % the noise hides the latter two, and half a sample where
it is short. Where a parameter is held at a value that is wrong by 3 %, and the logs tell it, up
to a third of good ones were said to be bad: what is told should be free, as it is by default.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WORSE = 1.5  # times what the better half of the logs leaves unexplained
POINTS = 1.0  # per cent of the fit that are worth a word
FAR = 8.0  # robust standard deviations of the better half of the logs
SURE = 5.0  # claimed standard deviations of a delay
LATE = 0.25  # samples of a delay that is worth a word
UNFINISHED = 1.0  # standard deviations: logs further from their end say less than they claim


def ailments(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return what is wrong with which logs.

    Parameters
    ----------
    rows : sequence of mapping
        Of all logs, some of which have estimates.

    Returns
    -------
    dict of str to list of str
        Name of the log, and sentences. A log is compared with the better half of all, so that a
        delay that all logs have is not among them: `common` tells that.
    """
    refused = {row["log"]: [row["problem"]] for row in rows if row.get("unlike")}
    rows = [row for row in rows if not row["problem"]]
    unexplained = np.array([100 - row["fit"] for row in rows])
    late = _late(rows)
    usual, far = _better(unexplained)
    worse = (unexplained > WORSE * usual) & (unexplained > usual + POINTS) & far
    usual_late, far = _better(late)
    moved = late - usual_late
    claimed = np.array([row["late"]["sd"] / row["period"] for row in rows])
    shifted = (abs(moved) > LATE) & (abs(moved) > SURE * claimed) & far
    found: dict[str, list[str]] = {}
    for i, row in enumerate(rows):
        said = found.setdefault(row["log"], [])
        if worse[i]:
            said.append(
                f"is fitted by {row['fit']:.3g} % only, others by "
                f"{100 - usual:.3g} %: something acts that the model does not know"
            )
        if shifted[i]:
            word = "later" if moved[i] > 0 else "earlier"
            said.append(f"its torque acts about {abs(moved[i]):.1g} samples {word} than in others")
        if row["left"] > UNFINISHED:
            said.append("its estimates did not settle: the axis is far from what is known of it")
    return {log: said for log, said in found.items() if said} | refused


def common(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what is wrong with the logs altogether, in sentences."""
    late, _ = _better(_late(rows))
    if abs(late) <= 2 * LATE:
        return []
    word = "later" if late > 0 else "earlier"
    return [
        f"the torque acts about {abs(late):.1g} samples {word} than the axis has it in most logs: "
        "identify it again, from one of them"
    ]


def _late(rows: Sequence[Mapping[str, Any]]) -> Array:
    return np.array([row["late"]["value"] / row["period"] for row in rows])


def _better(values: Array) -> tuple[float, NDArray[np.bool_]]:
    """Return the median of the half that is nearest to 0, and which are far from it."""
    half = values[np.argsort(abs(values))[: max(len(values) // 2, 1)]]
    middle = float(np.median(half))
    scatter = 1.4826 * float(np.median(abs(half - middle)))
    return middle, abs(values - middle) > FAR * scatter
