"""Names and units of the signals of a log, as people write them, in English, German or French."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

_TURN, _INCH, _POUND = 2 * np.pi, 0.0254, 4.4482216152605
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "torque": {
        "Nm": 1.0, "mNm": 1e-3, "cNm": 1e-2, "Ncm": 1e-2, "Nmm": 1e-3, "kNm": 1e3,
        "lbfin": _POUND * _INCH, "lbfft": _POUND * 12 * _INCH, "ozfin": _POUND / 16 * _INCH,
        "kgfm": 9.80665, "kgfcm": 0.0980665, "N": 1.0, "mN": 1e-3, "kN": 1e3, "lbf": _POUND,
        "A": 1.0, "mA": 1e-3, "V": 1.0, "mV": 1e-3, "%": 0.01, "1": 1.0,
    },
    "angle": {
        "rad": 1.0, "mrad": 1e-3, "deg": _TURN / 360, "arcmin": _TURN / 21600,
        "arcsec": _TURN / 1296000, "gon": _TURN / 400, "rev": _TURN,
        "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": _INCH,
    },
    "speed": {
        "rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _TURN / 360, "deg/min": _TURN / 21600,
        "rpm": _TURN / 60, "rev/s": _TURN,
        "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "m/min": 1 / 60, "mm/min": 1e-3 / 60,
        "in/s": _INCH,
    },
}  # fmt: skip
"""Units of each kind of signal, with their factor to SI. A torque may be a force, a current or a
command: k_T is then the torque of one such unit."""

LINEAR = {"m", "cm", "mm", "um", "nm", "in", "m/s", "cm/s", "mm/s", "m/min", "mm/min", "in/s"}
"""Units of axes that go straight: theirs are m, m/s, N and kg."""

_SPELLINGS = {
    "µs": "us", "μs": "us", "sec": "s", "seconds": "s", "second": "s", "minutes": "min",
    "nm": "Nm", "newtonmeter": "Nm", "mnm": "mNm", "amp": "A", "ampere": "A", "a": "A",
    "arms": "A", "ma": "mA", "milliampere": "mA", "volt": "V", "v": "V", "n": "N", "kn": "kN",
    "newton": "N", "lbin": "lbfin", "inlb": "lbfin", "inlbf": "lbfin", "lbft": "lbfft",
    "ftlb": "lbfft", "ftlbf": "lbfft", "ozin": "ozfin", "inoz": "ozfin", "lb": "lbf",
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "degrees/s": "deg/s",
    "radian": "rad", "radians": "rad", "radians/s": "rad/s", "turn": "rev", "turns": "rev",
    "radps": "rad/s", "degps": "deg/s", "rad_s": "rad/s", "deg_s": "deg/s", "m_s": "m/s",
    "mm_s": "mm/s", "mmps": "mm/s", "µm": "um", "μm": "um", "inch": "in", "metre": "m",
    "meter": "m", "1/min": "rpm", "u/min": "rpm", "min-1": "rpm", "rev/min": "rpm", "hz": "rev/s",
}  # fmt: skip

ENDINGS = {
    "time": {"ms", "us", "ns", "sec"},
    "torque": {"nm", "mnm", "mA", "lbin", "lbfin", "lbft", "ozin"},
    "angle": {"rad", "mrad", "deg", "rev", "mm", "um"},
    "speed": {"rpm", "radps", "degps", "mmps", "rad_s", "deg_s", "mm_s", "m_s"},
}
"""What the name of a column may end in after an underscore to be taken for its unit."""


def spelt(text: str) -> str:
    """Return a unit as `UNITS` has it."""
    plain = re.sub(r"[\s·*.^-]", "", text) if text.lower() != "min-1" else text
    return plain if any(plain in table for table in UNITS.values()) and plain != "nm" else (
        _SPELLINGS.get(plain.lower(), plain)
    )  # fmt: skip


WORDS = {
    "time": ("time", "zeit", "temps"),
    "torque": ("torque", "drehmoment", "moment", "couple", "motorstrom", "strom", "courant"),
    "angle": ("angle", "motorwinkel", "winkel"),
    "speed": ("speed", "drehzahl", "geschwindigkeit", "winkelgeschwindigkeit", "vitesse"),
}
"""Names of columns of each signal, the best first; capitals do not matter."""


def completed(given: Mapping[str, str], names: Sequence[str]) -> dict[str, str]:
    """Return columns of signals with those that are needed and not given, where there are any.

    Examples
    --------
    >>> completed({"angle": "phi"}, ["Zeit", "Moment", "Drehzahl", "phi"])
    {'angle': 'phi', 'time': 'Zeit', 'torque': 'Moment'}
    """
    found, taken = dict(given), {name.lower(): name for name in reversed(names)}
    for kind, words in WORDS.items():
        moves = kind in ("angle", "speed") and {"angle", "speed"} & found.keys()  # one is enough
        column = next((taken[word] for word in words if word in taken), None)
        if column is not None and not moves and column not in found.values():
            found.setdefault(kind, column)
    return found
