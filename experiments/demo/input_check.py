"""What a viewer may say: a click, one of the values that a control offers, where it looks from."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

UPDATE, CAMERA = "GuiUpdateMessage", "ViewerCameraMessage"
SLACK = 1e-9  # of a slider's length: a browser computes its steps in its own way


@dataclass(frozen=True)
class Choice:
    """A list of texts to choose from."""

    options: tuple[str, ...]

    def taken(self, value: Any) -> Any:
        """Return the value; ValueError if it was not offered."""
        if not isinstance(value, str) or value not in self.options:
            raise ValueError("only what is in the list can be chosen")
        return value


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`."""

    low: float
    high: float

    def taken(self, value: Any) -> Any:
        """Return the value; ValueError if it was not offered, as NaN never is."""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        slack = SLACK * (self.high - self.low)
        if not number or not self.low - slack <= value <= self.high + slack:
            raise ValueError(f"give a number from {self.low:g} to {self.high:g}")
        return min(max(float(value), self.low), self.high)


class InputCheck:
    """The controls of a page, and the one guard before them all.

    viser takes any value for any property of a control, and uploads to any of them; nothing gets
    there but what `admitted` gives back.

    Attributes
    ----------
    refused : callable
        Gets a line on what was not taken; the text of the viewer is not in it.
    """

    def __init__(self) -> None:
        self.refused: Callable[[str], None] = lambda _: None
        self._offered: dict[str, tuple[str, Choice | Range]] = {}

    def group(self, gui: Any, label: str, options: Sequence[str], **look: Any) -> Any:
        """Add a row of buttons and return viser's handle."""
        handle = gui.add_button_group(label, options, **look)
        return self._add(handle, label, Choice(tuple(options)))

    def choice(self, gui: Any, label: str, options: Sequence[str], *, initial: str) -> Any:
        """Add a list to choose from and return viser's handle."""
        handle = gui.add_dropdown(label, options, initial_value=initial)
        return self._add(handle, label, Choice(tuple(options)))

    def slider(  # noqa: PLR0917
        self, gui: Any, label: str, low: float, high: float, step: float, initial: float
    ) -> Any:
        """Add a slider and return viser's handle."""
        return self._add(gui.add_slider(label, low, high, step, initial), label, Range(low, high))

    def admitted(self, raw: Any) -> bytes | None:
        """Return a message of a viewer for viser, or None if it is not to hear it.

        Parameters
        ----------
        raw : bytes
            MessagePack, as viser's page sends it.
        """
        from msgspec import DecodeError, msgpack

        try:
            message = msgpack.decode(raw)
            return msgpack.encode(self._checked(message))
        except (DecodeError, ValueError, TypeError, KeyError, RecursionError) as error:
            known = type(error) is ValueError  # ours; the others are of messages nobody offered
            self.refused(f"refused: {error}" if known else "refused: nothing that was offered")
            return None

    def _add(self, handle: Any, label: str, offer: Choice | Range) -> Any:
        self._offered[handle._impl.uuid] = label, offer
        return handle

    def _checked(self, message: Mapping[str, Any]) -> dict[str, Any]:
        if message["type"] == CAMERA:
            return _camera(message)
        if message["type"] != UPDATE:
            raise KeyError  # uploads, requests for a tunnel, and what newer versions may know
        label, offer = self._offered[message["uuid"]]
        try:
            value = offer.taken(message["updates"]["value"])
        except ValueError as error:
            raise ValueError(f"{label}: {error}") from None
        # Nothing but the value goes on: viser would set any property.
        return {"type": UPDATE, "uuid": message["uuid"], "updates": {"value": value}}


def _camera(message: Mapping[str, Any]) -> dict[str, Any]:
    """Return a camera of finite numbers; what it is called and how many is viser's to check."""
    for key, value in message.items():
        numbers = value if isinstance(value, list) else [value]
        if key != "type" and not (len(numbers) <= 4 and all(map(math.isfinite, numbers))):
            raise KeyError
    return dict(message)
