"""The process in which an entry's code runs: it is told what an estimator may know, and no more.

It gets no seed, no fault and no truth: a scenario without its faults, and samples as they come. A
case is a process of its own, which forgets all when it ends.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.wire import Wire

MEMORY, FILE = 8 << 30, 256 << 20  # bytes
ENDED = 43  # status of a case that has ended as it should
FINDING = ("alarm", "onset", "parameters", "ratio")


def main() -> None:
    """Say how far this process is shut in, then serve cases until nobody asks any more."""
    _limit()
    wire = Wire(0, _private_output())
    wire.send(reached())
    _ready()
    while True:
        try:
            asked = wire.receive()
        except EntryError:  # nobody is there
            return
        if isinstance(asked, dict):  # anything else was for a case that has ended
            _in_a_process(wire, asked)


def _ready() -> None:
    """Import what every case needs, once for all of them."""
    import numba  # noqa: F401

    from flexaxis.estimators.sampling import overloads  # noqa: F401
    from flexaxis.experiments.building import specs  # noqa: F401


def _private_output() -> int:
    """Return a descriptor for answers; what is printed goes to stderr."""
    answers = os.dup(1)
    os.dup2(2, 1)
    return answers


def _limit() -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))


def reached() -> dict[str, bool]:
    """Return what holds in this process, as it finds it."""
    import socket

    try:
        others = {name for _, name in socket.if_nameindex()} - {"lo"}
        network = not others and not _connects()
    except OSError:
        network = False
    return {
        "no network": network,
        "no other processes": os.getpid() == 1,
        "no files of the user": Path("/entry").is_dir() and not _writes("/entry"),
        "no privileges": "CapEff:\t0000000000000000" in _status(),
        "no variables of the user": {*os.environ} <= KEPT,
    }


KEPT = {
    "PATH", "LANG", "HOME", "TMPDIR", "NUMBA_CACHE_DIR", "FLEXAXIS_CACHE", "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "LC_CTYPE", "PWD", "SHLVL", "_", "OLDPWD",
    "KMP_INIT_AT_FORK", "KMP_DUPLICATE_LIB_OK", "MPLCONFIGDIR", "SYSTEMROOT",
}  # fmt: skip
"""Variables of the environment that the process may have."""


def _connects() -> bool:
    """Whether anything but this computer could be reached: a route to an address is enough."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # of the documentation: sends nothing
        except OSError:
            return False
    return True


def _status() -> str:
    with suppress(OSError):
        return Path("/proc/self/status").read_text(encoding="utf-8")
    return ""


def _writes(folder: str) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _in_a_process(wire: Wire, asked: Mapping[str, Any]) -> None:
    """Serve a case in a process of its own, and leave nothing of it behind."""
    home = tempfile.mkdtemp()
    sys.stdout.flush()
    child = os.fork()
    if not child:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.setsid()
        os.environ["HOME"] = os.environ["TMPDIR"] = tempfile.tempdir = home
        _compiled_before(Path(home))
        try:
            _serve(wire, asked)
        except BaseException as error:
            with suppress(BaseException):
                wire.send({"error": f"{type(error).__name__}: {error}"[:2000]})
        finally:
            os._exit(ENDED)
    signal.signal(signal.SIGTERM, lambda number, frame: _stop(child, home))
    _, status = os.waitpid(child, 0)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _clean(child, home)
    if os.waitstatus_to_exitcode(status) != ENDED:  # else it has said what went wrong, if it did
        wire.send({"error": "the code has ended its process"})


def _stop(child: int, home: str) -> None:
    """End a case that does not end, and this process."""
    _clean(child, home)
    with suppress(OSError):
        os.waitpid(child, 0)
    os._exit(0)


def _compiled_before(home: Path) -> None:
    """Give a case what was compiled before: it can add to it, for itself, and change nothing."""
    kept = Path(os.environ["NUMBA_CACHE_DIR"])
    if not _writes(str(kept)) and kept.is_dir():
        (home / "compiled").mkdir()
        for path in kept.iterdir():
            (home / "compiled" / path.name).symlink_to(path)
        os.environ["NUMBA_CACHE_DIR"] = str(home / "compiled")


def _clean(child: int, home: str) -> None:
    """End what a case has started, and remove what it has written, as far as can be."""
    with suppress(OSError):
        # Everything but this process itself, where that is the first of its own world.
        os.kill(-1, signal.SIGKILL) if os.getpid() == 1 else os.killpg(child, signal.SIGKILL)
    with suppress(OSError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    shutil.rmtree(home, ignore_errors=True)
    if os.getpid() == 1:  # /tmp is of this world alone
        for path in Path("/tmp").iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _serve(wire: Wire, asked: Mapping[str, Any]) -> None:
    from flexaxis.estimators.protocol import run_estimator
    from flexaxis.experiments.building.specs import build, parse
    from flexaxis.sim.scenario import stored_scenario

    scenario = stored_scenario(asked["scenario"], source="the scenario")
    estimator: Any = build(parse(asked["estimator"]), scenario)
    able = [name for name in ("run", "reset", "covariance") if hasattr(estimator, name)]
    names = list(estimator.names)
    wire.send({"names": names, "output": estimator.output, "able": able})
    while True:
        got = wire.receive()
        if isinstance(got, np.ndarray):  # one sample, or u and y of many
            if len(got) == 2:
                y = None if np.isnan(got[1]) else float(got[1])
                wire.send(np.asarray(estimator.step(float(got[0]), y), float).reshape(-1))
            else:
                wire.send(run_estimator(estimator, *got.reshape(2, -1)).reshape(-1))
        elif got == "reset":
            estimator.reset()
        elif got == "told":
            wire.send(_told(estimator))
        else:
            return


def _told(estimator: Any) -> dict[str, Any]:
    """Return what an estimator claims and has found, as JSON has it."""
    covariance = getattr(estimator, "covariance", None)
    innovations = getattr(estimator, "innovations", None)
    findings = getattr(estimator, "findings", None)
    return {
        "covariance": _listed(covariance),
        "innovations": _listed(innovations),
        "findings": None if findings is None else [_finding(found) for found in findings],
    }


def _listed(values: Any) -> Any:
    return None if values is None else np.asarray(values, float).tolist()


def _finding(found: Any) -> dict[str, Any]:
    return {name: _plain(getattr(found, name)) for name in FINDING if hasattr(found, name)}


def _plain(value: Any) -> Any:
    if isinstance(value, str | None):
        return value
    return [_plain(each) for each in value] if hasattr(value, "__iter__") else float(value)


if __name__ == "__main__":
    main()
