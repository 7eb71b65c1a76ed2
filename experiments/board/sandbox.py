"""Run an entry's code where it can do little harm: each case under bubblewrap, or nothing is run.

A case is a process in namespaces of its own: no network, no other processes, no privileges, and of
the files only those of the system that programs need, Python, its packages and the entry, none of
which it can write. What it lacks of that is found before any code of the entry runs.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from importlib.resources import files
from math import inf
from multiprocessing import Pipe
from pathlib import Path
from threading import Event, Thread
from typing import Any, Self

from flexaxis.estimators.models.compiler import cache_folder
from flexaxis.experiments.board.entry import EntryError
from flexaxis.experiments.board.protocol import STARTING, Remote, Torques, Wire
from flexaxis.sim.errors import FlexaxisError

SYSTEM = ("/usr/bin", "/usr/sbin", "/usr/lib", "/usr/lib32", "/usr/lib64", "/usr/libexec",
          "/usr/share", "/usr/local/bin", "/usr/local/lib", "/bin", "/sbin", "/lib", "/lib32",
          "/lib64", "/etc/alternatives", "/etc/ld.so.cache")  # fmt: skip
OWN = ("--unshare-all", "--unshare-user", "--as-pid-1", "--new-session", "--die-with-parent",
       "--clearenv", "--cap-drop", "ALL", "--hostname", "board")  # fmt: skip
MEMORY, PROCESSES, ROOM = 4 << 30, 64, 256 << 20
"""Bytes that all processes of a case may hold, how many they may be, and bytes of its /tmp."""
IN_ALL = 10.0  # times the patience, for a case
LOOKING = 0.2  # s between looks at what a case takes
INSTALL = (
    "install bubblewrap (apt install bubblewrap, dnf install bubblewrap, pacman -S bubblewrap) on "
    "Linux; `--form` looks at the files only, and `--unconfined` runs code of your own with all "
    "your rights, which is never accepted"
)


class SandboxError(FlexaxisError):
    """The code of an entry cannot be shut in here; nothing of it was run."""


class Sandbox:
    """Where the code of one entry runs, one case at a time; a context manager.

    Parameters
    ----------
    entry : Path
        Its folder, in which the code runs and which it can only read.
    patience : float
        How long the code may take for an answer [s]; for a case in all, ten times that.
    confined : bool
        False for code of one's own, which then has the rights of the user.

    Attributes
    ----------
    reached : dict of str to bool
        What holds for a case, as one has found it before any code of the entry ran.

    Raises
    ------
    SandboxError
        On entering, if the code cannot be shut in here.
    """

    def __init__(self, entry: Path, *, patience: float = 600.0, confined: bool = True) -> None:
        self._entry, self._patience, self._confined = entry.resolve(), patience, confined
        self.reached: dict[str, bool] = {}

    def __enter__(self) -> Self:
        """Find out whether a case would be shut in; the process that told waits for the first."""
        if os.name == "nt":
            raise SandboxError("the code of an entry is run on Linux and macOS only; " + INSTALL)
        if self._confined and shutil.which("bwrap") is None:
            raise SandboxError("bubblewrap (bwrap) is missing, without which no code of an entry "
                               f"is run: {INSTALL}")  # fmt: skip
        self._next = self._process()
        try:
            self.reached = self._next.reached
            lacks = [what for what, holds in self.reached.items() if not holds]
            if self._confined and lacks:
                raise SandboxError(f"bubblewrap does not give a case: {', '.join(lacks)}")
        except EntryError as error:
            raise SandboxError(_refused(self._next.end())) from error
        except BaseException:
            self._next.end()
            raise
        return self

    def _process(self) -> _Process:
        return _Process(self._entry, self._patience, self._confined)

    def __exit__(self, *error: object) -> None:
        self._next.end()

    @contextmanager
    def case(self, asked: Mapping[str, Any], torques: Torques) -> Iterator[Remote]:
        """Give an estimator in a process of its own, which ends with all that it has started.

        Meanwhile the process of the next case begins, into which no code of the entry has come.

        Parameters
        ----------
        asked : mapping
            What it is told, as `protocol.serve` takes it.
        torques : callable
            Gives the torque of a nominal run, where the estimator asks for one.

        Raises
        ------
        EstimatorError
            If it cannot be made, or raises something.
        EntryError
            If its process gives no answer, or takes more than it may.
        """
        mine, self._next = self._next, self._process()
        try:
            assert mine.reached  # it is there
            mine.begin()
            yield Remote(mine.wire, asked, torques)
        finally:
            mine.end()


class _Process:
    """The process of one case, ours until it is told what to run."""

    def __init__(self, entry: Path, patience: float, confined: bool) -> None:
        self._home = "" if confined else tempfile.mkdtemp(prefix="flexaxis-")
        words, cwd = (command(entry), "/") if confined else (python(), str(entry))
        (back, out), (given, to) = Pipe(duplex=False), Pipe(duplex=False)
        self._process = subprocess.Popen(
            words, cwd=cwd, env=_environment(self._home), start_new_session=True,
            stdin=given.fileno(), stdout=out.fileno(), stderr=subprocess.PIPE,
        )  # fmt: skip
        given.close()
        out.close()
        self.wire, self._last, self._over = Wire(back, to, patience), inf, Event()
        Thread(target=self._watch, daemon=True).start()

    @cached_property
    def reached(self) -> dict[str, bool]:
        """What holds in it, as it has found itself."""
        return {str(k): v is True for k, v in self.wire.receive(patience=STARTING).items()}

    def begin(self) -> None:
        """Let the time of a case begin."""
        self._last = time.monotonic() + IN_ALL * self.wire.patience

    def end(self) -> str:
        """End it with all that it has started, and return what it has said last."""
        self._over.set()
        self._kill()
        assert self._process.stderr
        os.set_blocking(self._process.stderr.fileno(), False)
        with self._process:
            last = self._process.stderr.read(500) or b""
        if self._home:
            shutil.rmtree(self._home, ignore_errors=True)
        return last.decode(errors="replace").strip()

    def _kill(self) -> None:
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)  # the first of its world ends that

    def _watch(self) -> None:
        """End it as soon as it takes more time, processes or memory than it may."""
        while not self._over.wait(LOOKING):
            processes, size = usage(self._process.pid)
            now, patience = time.monotonic(), self.wire.patience
            taken = {
                f"gave no answer within {patience:g} s": self.wire.until < now,
                "gave no end": self._last < now,
                f"has {processes} processes; {PROCESSES} are allowed": processes > PROCESSES,
                f"holds {size >> 20} MB; {MEMORY >> 20} are allowed": size > MEMORY,
            }
            if why := [what for what, much in taken.items() if much]:
                self.wire.why = f"the code {why[0]}"
                return self._kill()


def command(entry: Path) -> list[str]:
    """Return the line that starts the process of a case under bubblewrap."""
    words = [
        shutil.which("bwrap") or "bwrap",
        *OWN,
        *_no_more_namespaces(),
        "--size",
        str(ROOM),
        "--tmpfs",
        "/tmp",
    ]
    for path in seen():
        words += ["--ro-bind", path, path]
    if os.path.islink(sys.executable):
        words += ["--symlink", os.path.realpath(sys.executable), sys.executable]
    words += ["--ro-bind", str(entry), "/entry", "--proc", "/proc", "--dev", "/dev"]
    if kept := cache_folder():
        words += ["--ro-bind", str(kept), "/cache"]
    # what root owns in /proc/sys he may write without any privilege
    words += [word for place in ("/proc", "/dev", "/") for word in ("--remount-ro", place)]
    words += ["--chdir", "/entry"]
    for name, value in _environment("/tmp").items():
        words += ["--setenv", name, value]
    return [*words, "--", *python()]


def python() -> list[str]:
    """Return the words that start the process of a case, without what is the user's own."""
    return [sys.executable, "-I", "-B", "-m", "flexaxis.experiments.board.protocol"]


@cache
def seen() -> list[str]:
    """Return what a case sees of the files but for the entry: system, Python and its packages.

    Not all of `sys.prefix`, where settings of its user lie beside them.
    """
    ours = [str(files(f"flexaxis.{p}")) for p in ("models_mjcf", "sim", "estimators")]
    ours.append(str(files("flexaxis.experiments")))
    packages = [place for place in sys.path if place.endswith(("site-packages", "dist-packages"))]
    settings = os.path.join(sys.prefix, "pyvenv.cfg")
    wanted = [*SYSTEM, os.path.realpath(sys.executable), f"{sys.base_prefix}/lib", settings]
    paths = sorted({os.path.abspath(p) for p in [*wanted, *packages, *ours] if os.path.exists(p)})
    return [p for p in paths if not any(p.startswith(f"{other}/") for other in paths)]


def usage(root: int) -> tuple[int, int]:
    """Return how many processes a process has started, and the bytes that they hold in all.

    None of those leaves the tree: in a world of its own an orphan becomes the child of its first.
    Where there is no /proc, nothing is seen.
    """
    parents: dict[int, int] = {}
    sizes: dict[int, int] = {}
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, IndexError, ValueError):  # it has just ended
            parents[int(place.name)] = int(
                (place / "stat").read_text().rpartition(")")[2].split()[1]
            )
            sizes[int(place.name)] = int((place / "statm").read_text().split()[1])
    found, new = {root}, {root}
    while new := {pid for pid, parent in parents.items() if parent in new} - found:
        found |= new
    return len(found), sum(sizes.get(pid, 0) for pid in found) * os.sysconf("SC_PAGE_SIZE")


def _environment(home: str) -> dict[str, str]:
    confined = home in {"", "/tmp"}
    return {
        "PATH": "/usr/local/bin:/usr/bin:/bin",
        "LANG": "C.UTF-8",
        "HOME": home or "/tmp",
        "TMPDIR": home or "/tmp",
        "OMP_NUM_THREADS": "1",
        "FLEXAXIS_COMPILED": "/cache" if confined else str(cache_folder() or home),
        "FLEXAXIS_CACHE": f"{home}/records",
    }


@cache
def _no_more_namespaces() -> tuple[str, ...]:
    """Return what forbids namespaces inside namespaces, where bubblewrap (0.8) knows it."""
    with suppress(OSError, subprocess.TimeoutExpired):
        said = subprocess.run(["bwrap", "--help"], capture_output=True, timeout=20, check=False)
        if b"--disable-userns" in said.stdout + said.stderr:
            return ("--disable-userns",)
    return ()


def _refused(last: str) -> str:
    return (
        f"the system refuses bubblewrap ({last or 'it ended without a word'}), without which no "
        "code of an entry is run: where user namespaces are forbidden, `sudo sysctl -w "
        "kernel.apparmor_restrict_unprivileged_userns=0` (Ubuntu) or `kernel."
        f"unprivileged_userns_clone=1` (Debian) allows them; else {INSTALL}"
    )
