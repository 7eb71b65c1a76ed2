"""Write down what changed, by how much, and how sure that is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexaxis.estimators.relocate.finding import UNEXPLAINED, Finding, interval_of
from flexaxis.estimators.relocate.memory import Present
from flexaxis.estimators.relocate.opened import Opened


def named(finding: Finding, case: Opened, state: Present, names: Sequence[str]) -> Finding:
    """
    Return a finding with what is in use now to explain it.

    Parameters
    ----------
    finding : Finding
    case : Opened
    state : record
        The filter, after what was taken up.
    names : sequence of str
        Of all parameters.
    """
    active, row = case.active, case.before.at(case.onset)
    after, before = state["theta"], row["theta"]
    late, early = (np.diag(r["claim"]) * r["noise"] for r in (state, row))
    return replace(
        finding,
        onset=case.onset,
        parameters=tuple(names[i] for i in active),
        ratio=tuple((after[active] / before[active]).tolist()),
        interval=tuple(
            interval_of(float(after[i]), float(before[i]), (late[i], early[i])) for i in active
        ),
        reason="" if len(active) else UNEXPLAINED,
    )
