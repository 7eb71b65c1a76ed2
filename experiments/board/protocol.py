"""What is said between a board's keeper and the code of an entry, and the end where that runs.

The code is told nominal values and samples, one by one: no seed, no fault, no scenario, no truth,
and the next sample only when the estimate before it is back. What it says is numbers and short
texts: of a length that is known before they are read, and never unpickled.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import inf
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board.entry import EntryError
from flexaxis.experiments.building.guest import stay

Array = NDArray[np.float64]
Torques = Callable[[Any], Array]

TEXTS = 65536  # bytes of an answer in words: of what it is, and what it has found
NAMES = 100  # that an estimator may have
SAID = 200  # characters of an error that are passed on: they may be shown to anybody
STARTING = 120.0  # s that a process may take to start
MEMORY, FILE, OPEN = 8 << 30, 64 << 20, 128  # of one process: bytes, bytes of a file, open files
FINDINGS = 500  # that are listened to, of a case
FINDING = ("alarm", "onset", "parameters", "ratio")


class Wire:
    """One end of two pipes: numbers go as they are, anything else as JSON.

    Parameters
    ----------
    back, to : Connection
    patience : float, optional
        How long an answer may take [s]: whoever watches ends the other process at `until`.

    Attributes
    ----------
    until : float
        When that is, by `time.monotonic`.
    why : str
        What is said where nobody is there any more.
    """

    def __init__(self, back: Connection, to: Connection, patience: float = inf) -> None:
        self._back, self._to, self.patience, self.until = back, to, patience, inf
        self.why = "the process that ran the code has ended"

    def send(self, content: Any) -> None:
        """Send numbers, or what JSON knows; EntryError if nobody takes it."""
        numbers = isinstance(content, np.ndarray)
        text = content.astype("<f8").tobytes() if numbers else _json(content)
        with self._waiting(self.patience):
            self._to.send_bytes((b"N" if numbers else b"J") + text)

    def receive(self, most: int = TEXTS, *, patience: float | None = None) -> Any:
        """Return a table, or numbers (n,).

        Parameters
        ----------
        most : int
            Bytes that it may have.
        patience : float, optional
            [s].

        Raises
        ------
        EntryError
            If nothing comes, in time or at all, or something else.
        """
        with self._waiting(patience or self.patience, most):
            content = self._back.recv_bytes(most + 1)
        try:
            if content[:1] == b"N":
                return np.frombuffer(content[1:], "<f8").astype(float)
            return json.loads(content[1:])
        except (ValueError, RecursionError) as error:
            raise EntryError("the code sent something that is no answer") from error

    @contextmanager
    def _waiting(self, patience: float, most: int = 0) -> Iterator[None]:
        self.until = time.monotonic() + patience
        try:
            yield
        except (EOFError, OSError) as error:
            if isinstance(error, OSError) and not error.errno:  # its length is that of no answer
                self.why = f"the code sent more than {most} bytes for an answer"
            raise EntryError(self.why) from error
        finally:
            self.until = inf


def _json(content: Any) -> bytes:
    return json.dumps(content, default=lambda value: value.tolist()).encode()


class Remote:
    """An estimator in another process, as one here: it gives numbers, and no more.

    Parameters
    ----------
    wire : Wire
    asked : mapping
        As `serve` takes it.
    torques : callable
        Gives the torque of a nominal run, where the estimator asks for one.

    Attributes
    ----------
    names : tuple of str
    output : str
    """

    def __init__(self, wire: Wire, asked: Mapping[str, Any], torques: Torques) -> None:
        self._wire, self._text = wire, str(asked["estimator"])
        wire.send(dict(asked))
        made = self._answer()
        if isinstance(made, dict) and "torque" in made:
            wire.send(torques("design" if made["torque"] == "design" else "reference"))
            made = self._answer()
        try:
            self.names = tuple(plain(name) for name in made["names"][:NAMES])
            self.output = plain(made["output"])
        except (LookupError, TypeError) as error:
            raise EntryError("the code sent something that is no answer") from error

    def step(self, u: float, y: float | None) -> Array:
        """Return θ[k] (p,); the next sample is sent after it has come."""
        self._wire.send(np.array([u, np.nan if y is None else y]))
        answer = self._answer(8 * NAMES)
        if not isinstance(answer, np.ndarray) or len(answer) != len(self.names):
            raise EstimatorError(
                f"{self._text}: gave {np.size(answer)} numbers, not {len(self.names)}"
            )
        return answer

    @property
    def findings(self) -> list[SimpleNamespace] | None:
        """What it has found, None of an estimator that looks for nothing."""
        self._wire.send("findings")
        found = self._answer()
        try:
            return None if found["findings"] is None else [*map(_finding, found["findings"])]
        except (AttributeError, LookupError, TypeError, ValueError, OverflowError) as error:
            raise EntryError("the code sent something that is no answer") from error

    def _answer(self, most: int = 0) -> Any:
        answer = self._wire.receive(max(most, TEXTS))
        if isinstance(answer, dict) and "error" in answer:
            raise EstimatorError(f"{self._text}: {plain(answer['error'])}")
        return answer


def plain(text: Any) -> str:
    """Return a text of somebody else's: short, and nothing in it that acts on who reads it."""
    return "".join(c if c.isprintable() else " " for c in str(text)[:SAID])


def _finding(found: Any) -> SimpleNamespace:
    return SimpleNamespace(
        alarm=int(found["alarm"]),
        onset=int(found.get("onset") or found["alarm"]),
        parameters=tuple(map(plain, found.get("parameters") or ())),
        ratio=tuple(map(float, found.get("ratio") or ())),
    )


def main() -> None:
    """Say how far this process is shut in, then run one case: the end where the code of it runs."""
    wire = _own_wire()
    _limit()
    _ready()
    stay()
    with suppress(EntryError, OSError):  # nobody is there any more
        wire.send(reached())
        try:
            serve(wire, wire.receive(1 << 30))
        except BaseException as error:
            wire.send({"error": f"{type(error).__name__}: {error}"[:SAID]})


def serve(wire: Wire, asked: Mapping[str, Any]) -> None:
    """Make an estimator and let it answer, until nobody asks any more.

    Parameters
    ----------
    wire : Wire
    asked : mapping
        ``estimator`` as for `--estimator`, and ``offer`` as of `Offer.as_data`.
    """
    from flexaxis.experiments.building.estimator_text import build_of, parse
    from flexaxis.experiments.building.offer import offer_from

    def torque(which: str) -> Any:
        wire.send({"torque": which})
        return wire.receive(1 << 30)

    estimator = build_of(parse(asked["estimator"]), offer_from(asked["offer"]), torque)
    wire.send({"names": list(estimator.names), "output": estimator.output})
    while True:
        got = wire.receive()
        if isinstance(got, np.ndarray):
            u, y = got.tolist()
            theta = estimator.step(u, None if np.isnan(y) else y)
            wire.send(np.asarray(theta, float).reshape(-1))
        else:
            found = getattr(estimator, "findings", None)
            if found is not None:
                found = [
                    {name: getattr(each, name) for name in FINDING if hasattr(each, name)}
                    for each in list(found)[:FINDINGS]
                ]
            wire.send({"findings": found})


def _own_wire() -> Wire:
    """Return what was given as standard input and output; nothing is left there."""
    back, to = (Connection(os.dup(descriptor)) for descriptor in (0, 1))
    nothing = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1):
        os.dup2(nothing, descriptor)
    return Wire(back, to)


def _limit() -> None:
    import resource

    limits = {"RLIMIT_CORE": 0, "RLIMIT_AS": MEMORY, "RLIMIT_FSIZE": FILE, "RLIMIT_NOFILE": OPEN}
    for name, value in limits.items():
        with suppress(ValueError, OSError):
            resource.setrlimit(getattr(resource, name), (value, value))


def _ready() -> None:
    """
    Import what every case needs, and give it what was compiled before: to add to, for itself.

    By links, whose targets it cannot write: what is kept may be more than a case has room for.
    """
    import numba  # noqa: F401

    from flexaxis.estimators.models import kernel  # noqa: F401
    from flexaxis.experiments.building import estimator_text as specs  # noqa: F401

    kept = Path(os.environ["FLEXAXIS_COMPILED"])
    if kept == Path("/cache"):
        own = Path(os.environ["HOME"]) / "compiled"
        if kept.is_dir():
            shutil.copytree(kept, own, copy_function=os.symlink)
        os.environ["FLEXAXIS_COMPILED"] = str(own)


def reached() -> dict[str, bool]:
    """Return what holds in this process, as it finds it."""
    with suppress(OSError):
        mounts = [x.split() for x in Path("/proc/self/mountinfo").read_text().splitlines()]
        lines = Path("/proc/self/status").read_text().splitlines()
        status = {key: value.strip() for key, _, value in (x.partition(":") for x in lines)}
        nothing = {status[key].strip("0") for key in ("CapEff", "CapPrm", "CapBnd", "CapInh")}
        writable = {x[4] for x in mounts if "ro" not in x[5].split(",")}
        return {
            "no network": {name for _, name in socket.if_nameindex()} <= {"lo"},
            "no other processes": [*Path("/proc").glob("[0-9]*")] == [Path("/proc/1")],
            "the entry where it belongs": Path.cwd() == Path("/entry"),
            "nothing to write to but /tmp": writable <= {"/tmp", "/dev/pts"} | _DEVICES,
            "no privileges": nothing == {""} and status["NoNewPrivs"] == "1",
        }
    return {"a /proc to look at": False}


_DEVICES = {f"/dev/{name}" for name in ("null", "zero", "full", "random", "urandom", "tty")}

if __name__ == "__main__":
    main()
