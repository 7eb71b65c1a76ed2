"""Run an entry's code in a process that is shut in, or not at all.

On Linux, `unshare` of util-linux gives it a world of its own: no network, no other processes, and
of the files only Python, its libraries and the entry, none of which it can write. `reached` says
what a process has found that was shut in as a case is. Where anything of it is lacking, nothing is
run, unless a plain process with the rights of the user is asked for.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.sampling.compiler import cache_folder
from flexaxis.experiments.board.child import CASE, END
from flexaxis.experiments.board.errors import CageError, EntryError
from flexaxis.experiments.board.wire import Wire
from flexaxis.experiments.board.world import UNSHARE, hidden, of_user, permitted, python, world_of
from flexaxis.experiments.building.offer import Torques, offer_of, torque_of
from flexaxis.experiments.building.specs import check_fits
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

PATH = "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin"
STARTING, ENDING = 120.0, 20.0  # s that the process may take to start, and to end a case
IN_ALL = 10.0  # times the patience, for a case
LONGEST, MOST = 2000, 1000  # characters of a text that code sends, and names that it may have


class Cage:
    """A process for the code of one entry; a context manager.

    Parameters
    ----------
    entry : Path
        Its folder, in which the code runs and which it can only read.
    patience : float
        How long the code may take for an answer [s]; for a case in all, ten times that, and no
        more processor time.
    plain : bool
        Whether to do without a world of its own: the code then has the rights of the user.

    Attributes
    ----------
    reached : dict of str to bool
        What holds for a case, as a process has found it before any code of the entry ran.

    Raises
    ------
    CageError
        On entering, if the code cannot be shut in here, and `plain` was not asked for.
    """

    def __init__(self, entry: Path, *, patience: float = 600.0, plain: bool = False) -> None:
        self._entry, self._patience, self._plain = entry.resolve(), patience, plain
        self._home, self._broken = "", False
        self.reached: dict[str, bool] = {}

    def __enter__(self) -> Self:
        """Start the process that serves cases."""
        if not hasattr(os, "fork"):
            raise EntryError(
                "an entry's code is run on Linux and macOS only, where a process can be split for "
                "each case: verify it there; --form looks at its files"
            )
        if not self._plain and not permitted():
            lies = f"{', '.join(hidden())} lies in /tmp, of which code gets one of its own"
            lacks = "`unshare` of util-linux is missing or not permitted"
            raise CageError(_refusal(lies if hidden() else lacks))
        self._home = tempfile.mkdtemp(prefix="flexaxis-") if self._plain else ""
        try:
            self._start()
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self._end()
        self._leave()

    def _leave(self) -> None:
        if self._home:
            shutil.rmtree(self._home, ignore_errors=True)

    def _start(self) -> None:
        self._control, theirs = socket.socketpair()
        with theirs:
            self._process = (self._plainly if self._plain else self._alone)(theirs)
        wire = Wire(self._control.fileno(), self._control.fileno(), STARTING)
        try:
            wire.send({"seconds": IN_ALL * self._patience})
            wire.send({"absent": of_user()})  # read by nobody who is there when cases are
            found = {str(k): v is True for k, v in wire.receive().items()}
        except (EntryError, OSError) as error:
            self._end()
            raise CageError(_refusal("the process for it cannot be started")) from error
        self.reached = {k: v and self.reached.get(k, True) for k, v in found.items()}
        lacks = [what for what, holds in found.items() if not holds]
        if lacks and not self._plain:
            self._end()
            raise CageError(_refusal(f"what it would lack here: {', '.join(lacks)}"))
        self._broken = False

    @contextmanager
    def case(self, estimator: str, scenario: Scenario) -> Iterator[Remote]:
        """Give an estimator in a process of its own, told what it may know of a scenario.

        Raises
        ------
        EstimatorError
            If it cannot be made, or raises something.
        EntryError
            If its process gives no answer.
        """
        if self._broken:
            self._end()
            self._start()
        mine, theirs = socket.socketpair()
        with mine, theirs:
            try:
                socket.send_fds(self._control, [CASE], [theirs.fileno()])
                theirs.close()
                wire = Wire(mine.fileno(), mine.fileno(), self._patience, IN_ALL * self._patience)
                wire.send({"estimator": estimator, "offer": offered(scenario)})
                remote = Remote(wire, estimator, partial(torque_of, scenario))
                check_fits(estimator, remote.names, remote.output, scenario)
                yield remote
            except EntryError:  # the process may be what is wrong
                self._broken = True
                raise
            except BrokenPipeError as error:
                self._broken = True
                raise EntryError("the process that ran the code has ended") from error
            finally:
                self._end_case()

    def _end_case(self) -> None:
        """Have a case ended with all that it has started; only then is there another."""
        with suppress(OSError):
            self._control.settimeout(ENDING)
            self._control.send(END)
            if self._control.recv(1) == END:
                return
        self._broken = True

    def _alone(self, given: socket.socket) -> subprocess.Popen[bytes]:
        """Start a process in a world of its own."""
        script = "\n".join(world_of(self._entry))
        return self._started([*UNSHARE, "sh", "-ec", script], given, cwd="/", home="/tmp")

    def _plainly(self, given: socket.socket) -> subprocess.Popen[bytes]:
        return self._started(python("child"), given, cwd=str(self._entry), home=self._home)

    def _started(
        self, words: Sequence[str], given: socket.socket, *, cwd: str, home: str
    ) -> subprocess.Popen[bytes]:
        kept = cache_folder()
        environment = {
            "PATH": PATH,
            "LANG": "C.UTF-8",
            "HOME": home,
            "TMPDIR": home,
            "OMP_NUM_THREADS": "1",
            "NUMBA_CACHE_DIR": str(kept or home) if self._plain else "/cache",
            "FLEXAXIS_CACHE": f"{home}/records",
        }
        return subprocess.Popen(
            words, cwd=cwd, env=environment, stdin=given.fileno(),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip

    def _end(self) -> None:
        self._control.close()
        with suppress(subprocess.TimeoutExpired):  # it ends what a case has started
            self._process.wait(5)
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


class Remote:
    """An estimator in another process, as one here; its answers are numbers and no more."""

    def __init__(self, wire: Wire, text: str, torques: Torques) -> None:
        self._wire, self._text = wire, text
        made = self._answer()
        if isinstance(made, dict) and "torque" in made:
            wire.send(torques("design" if made["torque"] == "design" else "reference"))
            made = self._answer()
        try:
            self.names = tuple(str(name)[:LONGEST] for name in made["names"][:MOST])
            self.output = str(made["output"])[:LONGEST]
            self.able = frozenset(map(str, made["able"]))
        except (LookupError, TypeError) as error:
            raise EntryError("the code sent something that is no answer") from error
        if "run" in self.able:
            self.run = self._run if "gaps" in self.able else self._whole
        if "reset" in self.able:
            self.reset = lambda: wire.send("reset")

    def step(self, u: float, y: float | None) -> Array:
        """Return θ[k] (p,); the next sample is sent after it has come."""
        self._wire.send(np.array([u, np.nan if y is None else y]))
        return self._numbers(len(self.names))

    def _whole(self, u: Array, y: Array) -> Array:
        return self._run(u, y)

    def _run(self, u: Array, y: Array, valid: Array | None = None) -> Array:
        """Return θ (N, p) of some samples, going on from where it is."""
        y = y if valid is None else np.where(valid, y, np.nan)
        if len(u) == 1:  # two numbers are a step
            return self.step(float(u[0]), float(y[0]))[None]
        self._wire.send(np.concatenate([u, y]))
        return self._numbers(len(u) * len(self.names)).reshape(len(u), -1)

    def told(self) -> SimpleNamespace:
        """Return what it claims and has found: ``covariance, innovations, findings``."""
        self._wire.send("told")
        given = self._answer()
        if not isinstance(given, dict):
            raise EntryError("the code sent something that is no answer")
        found = given.get("findings")
        return SimpleNamespace(
            covariance=_array(given.get("covariance")),
            innovations=_array(given.get("innovations")),
            findings=None if found is None else [_finding(each) for each in found],
        )

    def _numbers(self, size: int) -> Array:
        answer = self._answer()
        if not isinstance(answer, np.ndarray) or len(answer) != size:
            raise EstimatorError(f"{self._text}: gave {np.shape(answer)} numbers, not {size}")
        return answer

    def _answer(self) -> Any:
        answer = self._wire.receive()
        if isinstance(answer, dict) and "error" in answer:
            raise EstimatorError(f"{self._text}: {str(answer['error'])[:LONGEST]}")
        return answer


def offered(scenario: Scenario) -> dict[str, Any]:
    """Return what an estimator may know of a scenario, as data: nothing of the truth."""
    return offer_of(scenario).as_data() | {"name": "the scenario"}


def _array(values: Any) -> Array | None:
    return None if values is None else np.asarray(values, float)


def _finding(found: Any) -> SimpleNamespace:
    return SimpleNamespace(
        alarm=int(found["alarm"]),
        onset=int(found.get("onset") or found["alarm"]),
        parameters=tuple(map(str, found.get("parameters") or ())),
        ratio=tuple(map(float, found.get("ratio") or ())),
    )


def _refusal(why: str) -> str:
    return (
        f"the code of the entry cannot be shut in: {why}. Verify it on a Linux that lets you have "
        "namespaces (5.12 or newer); --form looks at its files only, and --plain runs its code "
        "with all your rights, which the verdict says"
    )
