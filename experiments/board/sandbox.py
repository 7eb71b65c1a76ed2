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
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.resources import files
from pathlib import Path
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
UNCONFINED = "unconfined"
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
        self._next = _Process(self._entry, self._patience, self._confined)
        try:
            self.reached = self._next.hello()
            lacks = [what for what, holds in self.reached.items() if not holds]
            if self._confined and lacks:
                raise SandboxError(f"bubblewrap does not give a case: {', '.join(lacks)}")
        except EntryError as error:
            raise SandboxError(_refused(self._next.end())) from error
        except BaseException:
            self._next.end()
            raise
        return self

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
        mine, self._next = self._next, _Process(self._entry, self._patience, self._confined)
        try:
            mine.hello()
            yield Remote(mine.wire, asked, torques)
        finally:
            mine.end()


class _Process:
    """The process of one case, ours until it is told what to run."""

    def __init__(self, entry: Path, patience: float, confined: bool) -> None:
        self._home = "" if confined else tempfile.mkdtemp(prefix="flexaxis-")
        words, cwd = (command(entry), "/") if confined else (python(), str(entry))
        self._process = subprocess.Popen(
            words, cwd=cwd, env=_environment(self._home), start_new_session=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
        )  # fmt: skip
        assert self._process.stdin and self._process.stdout
        back, to = self._process.stdout.fileno(), self._process.stdin.fileno()
        self.wire, self._told = Wire(back, to, patience, self._watch), False

    def hello(self) -> dict[str, bool]:
        """Return what holds in it, as it has found itself."""
        if self._told:
            return {}
        self._told = True
        return {str(k): v is True for k, v in self.wire.receive(patience=STARTING).items()}

    def end(self) -> str:
        """End it with all that it has started, and return what it has said last."""
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)  # the first of its world ends that
        assert self._process.stdin and self._process.stdout and self._process.stderr
        last = b""
        with suppress(OSError):
            os.set_blocking(self._process.stderr.fileno(), False)
            last = self._process.stderr.read(500) or b""
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            pipe.close()
        self._process.wait()
        if self._home:
            shutil.rmtree(self._home, ignore_errors=True)
        return last.decode(errors="replace").strip()

    def _watch(self) -> None:
        processes, size = usage(self._process.pid)
        if processes > PROCESSES:
            raise EntryError(f"the code has {processes} processes; {PROCESSES} are allowed")
        if size > MEMORY:
            raise EntryError(f"the code holds {size >> 20} MB; {MEMORY >> 20} are allowed")


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
