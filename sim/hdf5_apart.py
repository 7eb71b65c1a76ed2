"""HDF5 files of strangers: gone through in a process of their own before this one opens them.

A broken file may take along the process that reads it, and a small one unpack to more than there is
memory. One process serves all files, for to start it takes longer than to go through most of them.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import stat
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any

import h5py

from flexaxis.sim.hdf5_inside import only_inside
from flexaxis.sim.reading import Refusal

PATIENCE = 300.0
"""Seconds that a file may take; 1e8 samples with all true parameters take a tenth."""

MEMORY = 4 << 30
"""Bytes that the process may have: data are unpacked piece by piece, of megabytes each."""

MODULE = "flexaxis.sim.hdf5_apart"
_KEPT = 1000  # files of which is known that they are good


def gone_through(path: str | os.PathLike[str], refuse: Refusal, *, data: bool = True) -> None:
    """Go through a file in another process, which ends in our place if the file is a bad one.

    What merely cannot be read is left to who reads it, and so is a file that is not HDF5.

    Parameters
    ----------
    path : path-like
    refuse : callable
        Makes the error that is raised, from its message.
    data : bool
        Unpack all data; else only what describes them is read.
    """
    path = os.path.abspath(path)
    try:
        there = os.stat(path)
    except OSError:
        return
    if not stat.S_ISREG(there.st_mode):  # else who opens it may wait for ever
        return
    file = (path, there.st_ino, there.st_size, there.st_mtime_ns)
    if not {(file, True), (file, data)} & _reader.good:
        if said := _reader.ask(path, data):
            raise refuse(said)
        if len(_reader.good) >= _KEPT:
            _reader.good.clear()
        _reader.good.add((file, data))


class _Ended(Exception):
    """Its message is the status with which the process has ended, without a word."""


class _Reader:
    """The other process, which is started when it is first needed, and after it has ended."""

    def __init__(self) -> None:
        self.anew()

    def anew(self) -> None:
        """Begin without a process: that of before a fork is another one's."""
        self.good: set[tuple[tuple[str, int, int, int], bool]] = set()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, path: str, data: bool) -> str:
        """Return what is wrong with a file, or nothing."""
        question = json.dumps([path, data]).encode() + b"\n"
        with self._lock:
            try:
                if self._process is not None:
                    with suppress(_Ended):  # which something else may have ended since
                        return self._answer(self._process, question)
                return self._answer(self._started(), question)
            except _Ended as error:
                return f"the process that read it ended with status {error}; is it broken?"
            except OSError as error:
                self.end()
                return f"no process to read it ({error})"
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

    def _answer(self, process: subprocess.Popen[bytes], question: bytes) -> str:
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
        finally:
            late.cancel()
        if answer:
            return str(json.loads(answer))
        status = process.wait()
        self.end()
        if over.is_set():
            return f"not read within {PATIENCE:g} s; is it broken?"
        raise _Ended(status)

    def end(self) -> None:
        """End the process; the next file gets another one."""
        if self._process is not None:
            self._process.kill()
            with self._process:  # closes its pipes, and waits
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
        print(json.dumps(_fault(path, data)), flush=True)


def _fault(path: str, data: bool) -> str:
    """Return why nobody should open a file, or nothing."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            only_inside(file, _Refused)
            _describe(file)
            file.visititems(lambda name, item: _look(item, data))
    except _Refused as error:
        return str(error)
    except MemoryError:
        return "to read it takes more than the memory that it may have"
    except Exception:  # the HDF5 stack has many: whoever reads it says which, if it matters
        return ""
    return ""


class _Refused(Exception):
    """Its message is why."""


def _look(item: Any, data: bool) -> None:
    """Read what describes a data set, and unpack its data."""
    _describe(item)
    if not data or not isinstance(item, h5py.Dataset):
        return
    try:
        _unpack(item)
    except MemoryError:
        raise
    except Exception as error:
        # Unpacked to more than there is memory, too, HDF5 says no more than that it cannot be
        # read. What is packed in a way that is not installed here cannot be unpacked by us either.
        if all(map(h5py.h5z.filter_avail, _filters(item))):
            raise _Refused(f"{item.name} cannot be unpacked ({error})") from error


def _filters(dataset: h5py.Dataset) -> list[int]:
    """Return in which ways the pieces of a data set are packed."""
    how = dataset.id.get_create_plist()
    return [how.get_filter(i)[0] for i in range(how.get_nfilters())]


def _describe(item: Any) -> None:
    for name in item.attrs:
        with suppress(OSError, TypeError, ValueError, RuntimeError, KeyError):
            item.attrs[name]


def _unpack(dataset: h5py.Dataset) -> None:
    """Read what is more in memory than it is in the file: packed pieces, and texts."""
    if dataset.chunks is None:
        if dataset.dtype.hasobject and dataset.id.get_storage_size():
            dataset[()]
        return
    if not (dataset.dtype.hasobject or _filters(dataset)):
        return
    stored: list[tuple[int, ...]] = []  # what was never written has none, however large it says
    dataset.id.chunk_iter(lambda info: stored.append(info.chunk_offset))
    for offset in stored:
        dataset[tuple(slice(i, i + n) for i, n in zip(offset, dataset.chunks, strict=True))]


def _limit(memory: int) -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


if __name__ == "__main__":
    main()
