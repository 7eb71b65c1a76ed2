"""Which columns are signals by what they are called, in English, German or French."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
