"""HDF5 files of strangers: gone through in a process of their own before this one opens them.

A broken file may take along the process that reads it, and a small one unpack to more than there is
memory. One process serves all files, for to start it takes longer than to go through most of them.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import signal
import stat
import subprocess
import sys
import threading
from contextlib import suppress
from operator import add
from pathlib import Path
from typing import Any

import h5py

from flexaxis.sim.storage.hdf5_inside import only_inside
from flexaxis.sim.storage.reading import Refusal

PATIENCE = 300.0
"""Seconds that a file may take, as a log may."""

MEMORY = 4 << 30
"""Bytes that the process may have: data are unpacked piece by piece, of megabytes each."""

SPARE = 64 << 20
"""Bytes that a piece may take to unpack, beside four times what it says that it is."""

MODULE = "flexaxis.sim.storage.hdf5_apart"
MARK = b"\x1e"  # begins an answer
_KEPT = 1000  # files of which is known that they are good


def gone_through(
    path: str | os.PathLike[str], refuse: Refusal, *, data: bool = True, most: float = math.inf
) -> None:
    """Go through a file in another process, which ends in our place if the file is a bad one.

    What merely cannot be read is left to who reads it, and so is a file that is not HDF5, and the
    question whether its data lie elsewhere: `flexaxis.sim.storage.hdf5_inside.only_inside`.

    Parameters
    ----------
    path : path-like
    refuse : callable
        Makes the error that is raised, from its message.
    data : bool
        Unpack all data; else only what describes them is read.
    most : float
        Bytes that all data may be in memory together, written or not.
    """
    path = os.path.abspath(path)
    try:
        there = os.stat(path)
    except (OSError, ValueError):  # ValueError: no system has such a name
        return
    if not stat.S_ISREG(there.st_mode):  # else who opens it may wait for ever
        return
    file = (path, there.st_dev, there.st_ino, there.st_size, there.st_mtime_ns)
    if not {(file, True), (file, data)} & _reader.good.keys():
        size, said = _reader.ask(path, data)
        if said:
            raise refuse(said)
        if len(_reader.good) >= _KEPT:
            _reader.good.clear()
        _reader.good[file, data] = size
    size = _reader.good.get((file, True), _reader.good.get((file, data), 0.0))
    if size > most:
        raise refuse(f"says that it holds {size:.2g} bytes, where {most:.2g} are the most")


class _Ended(Exception):
    """Its message is the signal by which the process has ended, without a word."""


class _Reader:
    """The other process, which is started when it is first needed, and after it has ended."""

    def __init__(self) -> None:
        self.anew()

    def anew(self) -> None:
        """Begin without a process: that of before a fork is another one's."""
        self.good: dict[tuple[tuple[Any, ...], bool], float] = {}  # and how large they are [bytes]
        self._lock = threading.Lock()
        before: subprocess.Popen[bytes] | None = getattr(self, "_process", None)
        if before is not None and before.stdin is not None and before.stdout is not None:
            before.returncode = 0  # else Python warns of it when it is forgotten
            with suppress(OSError):
                before.stdin.close()
                before.stdout.close()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, path: str, data: bool) -> tuple[float, str]:
        """Return the size of the data of a file [bytes], and what is wrong with it, or nothing."""
        question = json.dumps([path, data]).encode() + b"\n"
        with self._lock:
            try:
                if self._process is not None:
                    with suppress(_Ended):  # which something else may have ended since
                        return self._answer(self._process, question)
                return self._answer(self._started(), question)
            except _Ended as error:
                return 0.0, f"the process that read it was ended by signal {error}; is it broken?"
            except (OSError, TypeError, ValueError, RuntimeError) as error:
                self.end()
                return 0.0, f"no process to read it with: {sys.executable!r}: {error}"
            except BaseException:  # as Ctrl-C: an answer that comes later is to no question
                self.end()
                raise

    def _started(self) -> subprocess.Popen[bytes]:
        # -P: what lies where the user stands is data, and no module of that process
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", MODULE, str(MEMORY)],
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # each takes of the memory
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return self._process

    def _answer(self, process: subprocess.Popen[bytes], question: bytes) -> tuple[float, str]:
        assert process.stdin is not None and process.stdout is not None
        over = threading.Event()

        def end() -> None:
            over.set()
            process.kill()

        late = threading.Timer(PATIENCE, end)
        late.start()
        try:
            with suppress(BrokenPipeError):
                process.stdin.write(question)
                process.stdin.flush()
            answer = process.stdout.readline()
            while answer and not answer.startswith(MARK):  # what else a Python says when it starts
                answer = process.stdout.readline()
        finally:
            late.cancel()
        if answer:
            size, said = json.loads(answer.removeprefix(MARK))
            return float(size), str(said)
        status = process.wait()
        self.end()
        if over.is_set():
            return 0.0, f"not read within {PATIENCE:g} s; is it broken?"
        if status < 0:
            raise _Ended(-status)
        raise RuntimeError(f"it ended with status {status}")

    def end(self) -> None:
        """End the process; the next file gets another one."""
        if self._process is not None:
            self._process.kill()
            with suppress(BrokenPipeError), self._process:  # closes its pipes, and waits
                pass
            self._process = None


_reader = _Reader()
atexit.register(_reader.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reader.anew)


def main() -> None:
    """Answer, a line for each file that is named on standard input, until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who asked
    _limit(int(sys.argv[1]))
    for line in sys.stdin:
        path, data = json.loads(line)
        _alarm(PATIENCE + 5.0)  # who asked may have been killed
        print(MARK.decode() + json.dumps(_found(path, data)), flush=True)
        _alarm(0.0)


def _found(path: str, data: bool) -> tuple[float, str]:
    """Return the size of the data of a file [bytes], and why nobody should open it, or nothing."""
    sizes = [0.0]
    try:
        with h5py.File(path, "r", locking=False) as file:
            only_inside(file, _Refused)
            _describe(file)
            file.visititems(lambda name, item: sizes.append(_look(item, data)))
    except _Refused as error:
        return sum(sizes), str(error)
    except MemoryError:
        return sum(sizes), "to read it takes more than the memory that it may have"
    except Exception:  # the HDF5 stack has many: whoever reads it says which, if it matters
        return sum(sizes), ""
    return sum(sizes), ""


class _Refused(Exception):
    """Its message is why."""


def _look(item: Any, data: bool) -> float:
    """Read what describes a data set, unpack its data, and return how large they are [bytes]."""
    _describe(item)
    if not isinstance(item, h5py.Dataset) or item.shape is None:
        return 0.0
    if data:
        _unpack(item)
    return float(math.prod(item.shape)) * item.id.get_type().get_size()


def _describe(item: Any) -> None:
    for name in item.attrs:
        with suppress(OSError, TypeError, ValueError, RuntimeError, KeyError):
            item.attrs[name]


def _unpack(dataset: h5py.Dataset) -> None:
    """Read what is more in memory than it is in the file: packed pieces, and texts."""
    if dataset.chunks is None:
        if dataset.id.get_storage_size() and _refers(dataset):
            _read(dataset, ())
        return
    stored: list[tuple[int, ...]] = []  # what was never written has none, however large it says
    if dataset.id.get_create_plist().get_nfilters():
        dataset.id.chunk_iter(lambda info: stored.append(info.chunk_offset))
    said = math.prod(dataset.chunks) * dataset.id.get_type().get_size()
    before = _peak_from_here()
    for i, offset in enumerate(stored, start=1):
        _read(dataset, tuple(map(slice, offset, map(add, offset, dataset.chunks))))
        if (i % 64 == 0 or i == len(stored)) and _peak() - before > 4 * said + SPARE:
            raise _Refused(f"{dataset.name} unpacks to more than the {said} bytes that it says")


def _refers(dataset: h5py.Dataset) -> bool:
    """Whether values lie elsewhere in the file, and may be of any length."""
    try:
        return bool(dataset.dtype.hasobject)
    except TypeError:  # of a type that NumPy has not
        return False


def _read(dataset: h5py.Dataset, where: tuple[slice, ...]) -> None:
    try:
        dataset[where]
    except MemoryError:
        raise
    except Exception:  # perhaps nobody wants it; who does is told
        return


def _peak_from_here() -> int:
    """Forget the most memory that this process had for earlier files, as far as the system can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # proc(5)
    return _peak()


def _peak() -> int:
    """Return the most memory that this process had [bytes]; 0 where that is not told."""
    with suppress(OSError, StopIteration):  # Linux; that of `getrusage` is of who started it, too
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM:")).split()[1]) << 10
    with suppress(ImportError):
        import resource

        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most if sys.platform == "darwin" else most << 10
    return 0


def _alarm(seconds: float) -> None:
    """End this process after so long, if it has not got further; 0 takes that back."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _limit(memory: int) -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


if __name__ == "__main__":
    main()
