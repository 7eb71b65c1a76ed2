"""What a swept key is called on an axis or in a table: words, with the unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from flexaxis.experiments.running.study import ALL
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS

_FAULT = re.compile(r"fault\[(\d+)\]\.(\w+)")
_OF_FAULT = {
    "factor": "{} after the fault / before",
    "at": "time of the fault of {} [s]",
    "over": "time over which {} changes [s]",
    "time_constant": "time constant of the change of {} [s]",
    "on": "time with the fault of {} [s]",
    "off": "time without the fault of {} [s]",
    "until": "end of the fault of {} [s]",
    "parameter": "parameter that changes",
    "kind": "kind of fault",
}
_KEYS = {
    "duration": "length of the run [s]",
    "period": "sampling period [s]",
    "start": "first estimate / nominal",
    "burn_in": "burn-in [s]",
    "noise.speed": "noise of the speed, 1σ [rad/s]",
    "noise.angle": "noise of the angle, 1σ [rad]",
    "noise.torque": "noise of the torque, 1σ [N m]",
    "encoder.counts": "counts of the encoder in a turn",
    "delay.measurement": "delay of the measurement [samples]",
    "delay.torque": "delay of the torque [s]",
    "filter.speed": "time constant of the filter of the speed [s]",
    "controller.Kp": "position gain [1/s]",
    "controller.Kv": "speed gain [N m s/rad]",
    "controller.Ki": "integral gain [1/s]",
    "controller.tau": "time constant of the controller [s]",
    "controller.rate": "rate of the controller [Hz]",
    "excitation.low": "lower end of the excitation [Hz]",
    "excitation.high": "upper end of the excitation [Hz]",
    "excitation.period": "period of the excitation [s]",
    "excitation.rms": "size of the reference, rms [rad]",
    "excitation.reach": "reach of the moves [rad]",
    "excitation.move": "time of a move [s]",
    "excitation.dwell": "rest after a move [s]",
    "friction.coulomb": "Coulomb friction [N m]",
    "backlash.gear": "gap of the gear [rad]",
    "cogging.amplitude": "cogging, amplitude [N m]",
    "cogging.poles": "periods of cogging in a turn",
    "stiffening.gear": "cubic over linear stiffness of the gear [1/rad²]",
    "saturation.torque": "limit of the torque [N m]",
    "told.noise": "noise as told, 1σ [rad/s]",
    "told.torque_limit": "limit of the torque as told [N m]",
    "told.poles": "periods of cogging as told",
}
_OPTIONS = {
    "forgetting": "forgetting factor λ",
    "regularization": "regularisation μ",
    "drift": "size of the drift Δ",
}


def axis_words(key: str, study: Mapping[str, Any]) -> str:
    """Return what a swept key is called: words with the unit, else the key.

    Parameters
    ----------
    key : str
        Such as ``"fault[0].factor"`` or ``"rpem-forgetting.forgetting"``.
    study : mapping
        As in study.json: its estimators, and the definitions of its scenarios.

    Examples
    --------
    >>> axis_words("noise.speed", {})
    'noise of the speed, 1σ [rad/s]'
    >>> axis_words("ekf.forgetting", {"estimators": ["ekf"]})
    'forgetting factor λ of ekf'
    """
    if key in _KEYS:
        return _KEYS[key]
    if fault := _FAULT.fullmatch(key):
        return _of_fault(int(fault[1]), fault[2], study) or key
    table, _, name = key.rpartition(".")
    if table == "parameters" and name in (units := PARAMETER_UNITS | dict(LAW_UNITS)):
        return f"{name} [{units[name]}]"
    if table == "told":
        return f"{name} as told / true nominal"
    if table == ALL or any(table == text.partition("[")[0] for text in study.get("estimators", ())):
        whose = "" if table == ALL else f" of {table}"
        return f"{_OPTIONS.get(name, name.replace('_', ' '))}{whose}"
    return key


def _of_fault(place: int, name: str, study: Mapping[str, Any]) -> str | None:
    """Return the words of a key of a fault; of one whose parameter is swept too, without it."""
    if name not in _OF_FAULT:
        return None
    faults = [entry["definition"].get("fault", ()) for entry in study.get("scenarios", ())]
    named = {each[place].get("parameter") for each in faults if len(each) > place}
    fixed = len(named) == 1 and f"fault[{place}].parameter" not in study.get("axes", ())
    return _OF_FAULT[name].format(named.pop() if fixed else f"parameter {place + 1}")
