"""Run an entry's code in a process that is shut in as far as this system allows.

On Linux, `unshare` of util-linux gives it a world of its own: no network, no other processes, and
of the files only Python, its libraries and the entry, none of which it can write. Elsewhere, or
where that is not permitted, it is a plain process with an environment, a home and limits of its
own; `reached` says which it is, as the process itself has found it.
"""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.sampling.compiler import cache_folder
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.wire import Wire
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

UNSHARE = ("unshare", "--user", "--map-root-user", "--net", "--mount", "--pid", "--ipc", "--uts",
           "--fork", "--kill-child")  # fmt: skip
SYSTEM = ("/usr", "/bin", "/lib", "/lib64", "/sbin", "/etc/alternatives", "/etc/ld.so.cache",
          "/etc/fonts")  # fmt: skip
POWERLESS = ("setpriv", "--no-new-privs", "--bounding-set=-all", "--inh-caps=-all")
"""Whoever made the world could undo it; whoever runs in it cannot."""
DEVICES = ("null", "zero", "random", "urandom")
PATH = "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin"
STARTING = 120.0  # s that the process may take to start, with what Python imports


class Cage:
    """A process for the code of one entry; a context manager.

    Parameters
    ----------
    entry : Path
        Its folder, in which the code runs and which it can only read.
    patience : float
        How long the code may take for an answer [s].
    plain : bool
        Whether to do without a world of its own, for tests.

    Attributes
    ----------
    reached : dict of str to bool
        What holds in the process, as it has found it before any code of the entry ran.
    """

    def __init__(self, entry: Path, *, patience: float = 600.0, plain: bool = False) -> None:
        self._entry, self._patience, self._plain = entry.resolve(), patience, plain
        self._home, self._broken = "", False
        self.reached: dict[str, bool] = {}

    def __enter__(self) -> Self:
        """Start the process, shut in if that is possible."""
        self._home = tempfile.mkdtemp(prefix="flexaxis-")
        self._start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end()
        shutil.rmtree(self._home, ignore_errors=True)

    def _start(self) -> None:
        ways = [self._plainly] if self._plain or not _permitted() else [self._alone, self._plainly]
        for start in ways:
            self._process = start()
            assert self._process.stdin is not None and self._process.stdout is not None
            self._wire = Wire(self._process.stdout.fileno(), self._process.stdin.fileno(), STARTING)
            try:
                found = {str(k): v is True for k, v in self._wire.receive().items()}
            except EntryError:
                self._end()
                continue
            self.reached = {k: v and self.reached.get(k, True) for k, v in found.items()}
            self._wire.patience, self._broken = self._patience, False
            return
        raise EntryError("the process for the code of the entry cannot be started")

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
        try:
            self._wire.send({"estimator": estimator, "scenario": told(scenario)})
            yield Remote(self._wire, estimator)
        except EntryError:  # what comes next may belong to this
            self._broken = True
            raise
        except BrokenPipeError as error:
            self._broken = True
            raise EntryError("the process that ran the code has ended") from error
        finally:
            with suppress(OSError):
                self._wire.send("end")

    def _alone(self) -> subprocess.Popen[bytes]:
        """Start a process in a world of its own."""
        script = "\n".join(_world(self._home, self._entry))
        return self._started([*UNSHARE, "sh", "-ec", script], cwd="/", home="/tmp")

    def _plainly(self) -> subprocess.Popen[bytes]:
        return self._started(_python(), cwd=str(self._entry), home=self._home)

    def _started(self, words: Sequence[str], *, cwd: str, home: str) -> subprocess.Popen[bytes]:
        kept = cache_folder()
        self._shut_in = shut_in = home == "/tmp"
        environment = {
            "PATH": PATH,
            "LANG": "C.UTF-8",
            "HOME": home,
            "TMPDIR": home,
            "OMP_NUM_THREADS": "1",
            "NUMBA_CACHE_DIR": "/cache" if shut_in else str(kept or home),
            "FLEXAXIS_CACHE": f"{home}/records",
        }
        return subprocess.Popen(
            words, bufsize=0, cwd=cwd, env=environment, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip

    def _end(self) -> None:
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()
        with suppress(subprocess.TimeoutExpired):  # a case has a group of its own, to be ended too
            if not self._shut_in:  # a world of its own ends as a whole
                self._process.terminate()
                self._process.wait(5)
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


class Remote:
    """An estimator in another process, as one here; its answers are numbers and no more."""

    def __init__(self, wire: Wire, text: str) -> None:
        self._wire, self._text = wire, text
        made = self._answer()
        try:
            self.names = tuple(str(name) for name in made["names"])
            self.output, self.able = str(made["output"]), frozenset(map(str, made["able"]))
        except (LookupError, TypeError) as error:
            raise EntryError("the code sent something that is no answer") from error
        if "run" in self.able:
            self.run = self._run
        if "reset" in self.able:
            self.reset = lambda: wire.send("reset")

    def step(self, u: float, y: float | None) -> Array:
        """Return θ[k] (p,); the next sample is sent after it has come."""
        self._wire.send(np.array([u, np.nan if y is None else y]))
        return self._numbers(len(self.names))

    def _run(self, u: Array, y: Array) -> Array:
        """Return θ (N, p) of some samples, going on from where it is."""
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
            raise EstimatorError(f"{self._text}: {answer['error']}")
        return answer


def told(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario as data, as an estimator may know it: nothing of what will happen."""
    quiet = scenario.override({"name": "hidden", "card": "", "fault": [], "nuisance": None})
    return quiet.resolved()


def _array(values: Any) -> Array | None:
    return None if values is None else np.asarray(values, float)


def _finding(found: Any) -> SimpleNamespace:
    return SimpleNamespace(
        alarm=int(found["alarm"]),
        onset=int(found.get("onset") or found["alarm"]),
        parameters=tuple(map(str, found.get("parameters") or ())),
        ratio=tuple(map(float, found.get("ratio") or ())),
    )


def _python() -> list[str]:
    return [sys.executable, "-I", "-B", "-m", "flexaxis.experiments.board.child"]


def _permitted() -> bool:
    """Whether this system gives a process a world of its own."""
    if not sys.platform.startswith("linux") or shutil.which(UNSHARE[0]) is None:
        return False
    tried = subprocess.run([*UNSHARE, "true"], capture_output=True, check=False, timeout=20)
    return tried.returncode == 0


def _world(root: str, entry: Path) -> Iterator[str]:
    """Yield the lines of a shell that make a world and go on in it."""
    new = shlex.quote(root)
    yield f"mount -t tmpfs -o size=512m none {new}"
    for path in _seen():
        yield from _bound(path, f"{root}{path}")
    yield from _bound(str(entry), f"{root}/entry")
    if kept := cache_folder():
        yield from _bound(str(kept), f"{root}/cache")
    yield f"mkdir -p {new}/tmp {new}/proc {new}/dev"
    yield f"mount -t tmpfs -o size=256m none {new}/tmp"
    yield f"mount -t proc proc {new}/proc"
    for name in DEVICES:
        yield f"touch {new}/dev/{name}; mount --bind /dev/{name} {new}/dev/{name}"
    yield f"mount -o remount,ro {new}"
    inside = f"cd /entry; exec {shlex.join([*POWERLESS, *_python()])}"
    yield f"exec chroot {new} /bin/sh -c {shlex.quote(inside)}"


def _bound(source: str, target: str) -> Iterator[str]:
    there, here = shlex.quote(source), shlex.quote(target)
    if Path(source).is_file():
        yield f"mkdir -p {shlex.quote(str(Path(target).parent))}; touch {here}"
    else:
        yield f"mkdir -p {here}"
    yield f"mount --rbind {there} {here}; mount -o remount,bind,ro {here}"


def _seen() -> list[str]:
    """Return the folders that Python and its libraries need, those inside others left out."""
    ours = [files(f"flexaxis.{part}") for part in ("models_mjcf", "sim", "estimators")]
    ours.append(files("flexaxis.experiments"))
    wanted = [*SYSTEM, sys.prefix, sys.base_prefix, *map(str, ours)]
    wanted += [place for place in sys.path if "site-packages" in place]
    wanted += [str(Path(sys.executable).resolve().parent.parent)]
    paths = sorted({os.path.abspath(place) for place in wanted if Path(place).exists()}, key=len)
    kept: list[str] = []
    for path in paths:
        if path != "/" and not any(path.startswith(f"{other}/") for other in kept):
            kept.append(path)
    return kept
