"""What a doubt advises, done to a record that is already imported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import sosfilt

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.prepare import highpass_filter, interval_means
from flexaxis.sim.record import Record

ON_RECORDS = ("highpass", "torque_is")
"""Remedies that `remedied` knows; others, such as ``friction``, are for the estimator."""


def remedied(record: Record, remedy: Mapping[str, Any]) -> Record:
    """Return a record as the import would have made it with these options.

    Parameters
    ----------
    record : Record
    remedy : mapping
        ``highpass``: corner of the filter [Hz]; ``torque_is = "smooth"`` for a torque that was
        taken for a held one. Other keys are passed over.

    Raises
    ------
    LogError
        If it cannot be done to a record: import the log again.
    """
    kind = record.versions.get("torque", "held")
    wanted = remedy.get("torque_is", kind)
    if wanted != kind:
        if wanted != "smooth" or "highpass" in record.versions:
            raise LogError(
                f"the record holds the means of a {kind} torque; import the log again with "
                f"--torque-is {wanted}"
            )
        record = _as_smooth(record)
    return _highpassed(record, float(remedy["highpass"])) if "highpass" in remedy else record


def _as_smooth(record: Record) -> Record:
    time, torque = record.time, record.torque
    means = interval_means(time, torque, time, record.period, smooth=True)
    told = record.versions | {"torque": "smooth", "torque_because": "tried"}
    return replace(record, torque=means, versions=told)


def _highpassed(record: Record, corner: float) -> Record:
    sos = highpass_filter(corner, record.period)
    changed: dict[str, Any] = {}
    for name in ("torque", "angle", "speed", "increment", "true_angle_a"):
        values = getattr(record, name)
        if values is not None:
            start = values[0] if "angle" in name else 0.0
            changed[name] = np.asarray(sosfilt(sos, values - start))
    told = record.versions | {"highpass": f"{corner:g}"}
    return replace(record, **changed, versions=told)
