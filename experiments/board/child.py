"""The process in which an entry's code runs: it is told what an estimator may know, and no more.

It gets no seed, no fault, no scenario and no truth: nominal values, and samples as they come. A
case is a process of its own, on a socket of its own: it ends, and with it all that it has started,
before there is another.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import socket
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.board import shut, sieve
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.wire import Wire

MEMORY, FILE = 8 << 30, 256 << 20  # bytes of a process and of a file
ENDED = 43  # status of a case that has ended as it should
CASE, END = b"c", b"e"  # what is said on the first socket, which no case has
LOOKING = 0.2  # s between looks at whether a case has ended on its own
FINDING = ("alarm", "onset", "parameters", "ratio")


def main() -> None:
    """Say how far a case is shut in, then serve cases until nobody asks any more."""
    _limit()
    shut.unreadable()
    control = _own_socket()
    wire = Wire(control.fileno(), control.fileno())
    with suppress(EntryError, OSError):  # nobody is there any more
        asked = wire.receive()
        wire.send(_tried(wire))
        _ready()
        while True:
            word, sockets, *_ = socket.recv_fds(control, 1, 1)
            if not word or not _in_a_process(control, sockets[0], asked["seconds"]):
                break
    if os.getpid() != 1:  # else all of this world ends
        shutil.rmtree(os.environ["HOME"], ignore_errors=True)


def _ready() -> None:
    """Import what every case needs, once for all of them."""
    import numba  # noqa: F401

    from flexaxis.estimators.sampling import overloads  # noqa: F401
    from flexaxis.experiments.building import specs  # noqa: F401


def _own_socket() -> socket.socket:
    """Return what was given as standard input; nothing is left there."""
    control = socket.socket(fileno=os.dup(0))
    nothing = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1):
        os.dup2(nothing, descriptor)
    return control


def _limit() -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))


def _tried(wire: Wire) -> dict[str, bool]:
    """Return what holds in a process as a case's, which alone is told what must not be seen."""
    memory = _memory()
    there, here = os.pipe()
    child = os.fork()
    if not child:
        with suppress(BaseException):
            _shut_in(60.0)
            os.write(here, json.dumps(reached(wire.receive()["absent"], memory)).encode())
        os._exit(0)
    os.close(here)
    os.waitpid(child, 0)
    with os.fdopen(there) as answer:
        found: dict[str, bool] = json.loads(answer.read())
    return found


def reached(absent: Sequence[str], memory: str) -> dict[str, bool]:
    """Return what holds in this process, as it finds it.

    Parameters
    ----------
    absent : sequence of str
        Files and folders of the user, of which none may be seen.
    memory : str
        What `_memory` says where cases come from.
    """
    try:
        others = {name for _, name in socket.if_nameindex()} - {"lo"}
        network = not others and not _connects() and not sieve.other_sockets()
    except OSError:
        network = False
    nothing = {shut.status(key).strip("0") for key in ("CapEff", "CapPrm", "CapBnd", "CapInh")}
    unseen = not any(map(os.path.lexists, absent))
    return {
        "no network": network,
        "no other processes": os.getppid() == 1,
        "no files of the user": unseen and Path("/entry").is_dir(),
        "nothing to write to but /tmp": not _writes("/entry") and shut.only_reads(),
        "no privileges": nothing == {""}
        and shut.status("NoNewPrivs") == "1"
        and shut.status("Seccomp") == sieve.SIFTED,
        "no shared memory": _memory() not in {"", memory},
        "no variables of the user": {*os.environ} <= KEPT,
    }


def _memory() -> str:
    """Return which memory this process may share, "" where that is not known."""
    with suppress(OSError):
        return os.readlink("/proc/self/ns/ipc")
    return ""


def _shut_in(seconds: float) -> None:
    """Leave the process that serves cases nothing that the next could find."""
    alone = os.getppid() == 1
    os.setsid()
    shut.limited(seconds, alone=alone)
    if alone:
        shut.own_memory()
        shut.powerless()
        sieve.sift()
    shut.unreadable(False)


KEPT = {
    "PATH", "LANG", "HOME", "TMPDIR", "NUMBA_CACHE_DIR", "FLEXAXIS_CACHE", "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "LC_CTYPE", "PWD", "SHLVL", "_", "OLDPWD",
    "KMP_INIT_AT_FORK", "KMP_DUPLICATE_LIB_OK", "MPLCONFIGDIR", "SYSTEMROOT",
}  # fmt: skip
"""Variables of the environment that the process may have."""


def _connects() -> bool:
    """Whether anything but this computer could be reached: a route to an address is enough."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # of the documentation: sends nothing
        except OSError:
            return False
    return True


def _writes(folder: str) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _in_a_process(control: socket.socket, own: int, seconds: float) -> bool:
    """Serve a case in a process of its own, leave nothing of it, and say whether to go on."""
    home = tempfile.mkdtemp()
    child = os.fork()
    if not child:
        control.close()
        _case(Wire(own, own), home, seconds)
    with socket.socket(fileno=own) as data:
        goes_on = _until_told(control, data, child)
        _clean(child, home)
    if goes_on:
        control.send(END)
    return goes_on


def _case(wire: Wire, home: str, seconds: float) -> None:
    """Run one case, and end this process."""
    try:
        os.environ["HOME"] = os.environ["TMPDIR"] = tempfile.tempdir = home
        _compiled_before(Path(home))
        _shut_in(seconds)
        _serve(wire, wire.receive())
    except BaseException as error:
        with suppress(BaseException):
            wire.send({"error": f"{type(error).__name__}: {error}"[:2000]})
    finally:
        os._exit(ENDED)


def _until_told(control: socket.socket, data: socket.socket, child: int) -> bool:
    """Wait until a case is to end, and say what became of it; False if nobody is there to ask."""
    running = True
    while not select.select([control], [], [], LOOKING if running else None)[0]:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            running = False
            with suppress(OSError):
                if os.waitstatus_to_exitcode(status) != ENDED:  # else it has said what went wrong
                    wire = Wire(data.fileno(), data.fileno())
                    wire.send({"error": "the code has ended its process"})
                data.shutdown(socket.SHUT_WR)
    return bool(control.recv(1))


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
        while os.waitpid(-1, 0)[0]:
            pass
    shutil.rmtree(home, ignore_errors=True)
    shut.no_keys()
    if os.getpid() == 1:  # /tmp is of this world alone
        for path in Path("/tmp").iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _serve(wire: Wire, asked: Mapping[str, Any]) -> None:
    from flexaxis.estimators.protocol import run_estimator
    from flexaxis.experiments.building.offer import offer_from
    from flexaxis.experiments.building.specs import build_of, parse
    from flexaxis.experiments.conformance.requirements import knows_gaps

    def torque(which: str) -> Any:
        wire.send({"torque": which})
        return wire.receive()

    estimator: Any = build_of(parse(asked["estimator"]), offer_from(asked["offer"]), torque)
    able = [name for name in ("run", "reset", "covariance") if hasattr(estimator, name)]
    able += ["gaps"] if knows_gaps(estimator) else []
    names = list(estimator.names)
    wire.send({"names": names, "output": estimator.output, "able": able})
    while True:
        got = wire.receive()
        if isinstance(got, np.ndarray):  # one sample, or u and y of many
            if len(got) == 2:
                y = None if np.isnan(got[1]) else float(got[1])
                wire.send(np.asarray(estimator.step(float(got[0]), y), float).reshape(-1))
            else:
                u, measured = got.reshape(2, -1)
                valid = ~np.isnan(measured)  # else any finite value may stand there
                theta = run_estimator(estimator, u, np.where(valid, measured, 0.0), valid)
                wire.send(theta.reshape(-1))
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
