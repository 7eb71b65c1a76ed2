"""System calls with which a process shuts itself in; each does nothing where there is no such call.

Linux only, by libc: prctl(2), capset(2), unshare(2), mount_setattr(2), sethostname(2).
"""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

_DUMPABLE, _BOUNDING_DROP, _NO_NEW_PRIVILEGES, _AMBIENT = 4, 24, 38, 47  # of prctl
_AMBIENT_CLEAR, _CAPABILITIES = 4, 64
_NEW_IPC = 0x08000000
_CAPABILITY_VERSION = 0x20080522
_MOUNT_SETATTR, _RECURSIVE, _READ_ONLY = 442, 0x8000, 1  # the number is that of every machine
_JOIN_SESSION_KEYRING = 1
_KEYCTL = {"x86_64": 250, "aarch64": 219, "riscv64": 219}
_CLEAR_KEYRING, _USER_KEYRINGS = 7, (-4, -5)
HOST = "board"
PROCESSES = 256


def unreadable(yes: bool = True) -> None:
    """Let no other process of this user read or write this one's memory."""
    if library := libc():
        library.prctl(_DUMPABLE, int(not yes), 0, 0, 0)


def powerless() -> None:
    """Give away all capabilities, those included that a program could give back."""
    if library := libc():
        for number in range(_CAPABILITIES):
            library.prctl(_BOUNDING_DROP, number, 0, 0, 0)
        library.prctl(_AMBIENT, _AMBIENT_CLEAR, 0, 0, 0)
        library.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
        head = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION, 0)
        library.capset(head, (ctypes.c_uint32 * 6)())


def own_memory() -> None:
    """Take System V and POSIX message queues, semaphores, shared memory and keys of one's own."""
    if library := libc():
        library.unshare(_NEW_IPC)
        if number := _KEYCTL.get(os.uname().machine):
            library.syscall(number, _JOIN_SESSION_KEYRING, None)


def no_keys() -> None:
    """Remove the keys that processes of this user have left in the kernel."""
    if (library := libc()) and (number := _KEYCTL.get(os.uname().machine)):
        for ring in _USER_KEYRINGS:
            library.syscall(number, _CLEAR_KEYRING, ring)


def limited(seconds: float, *, alone: bool) -> None:
    """Limit the processor time [s] of this process, and processes where only its own count."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))
        if alone:
            resource.setrlimit(resource.RLIMIT_NPROC, (PROCESSES, PROCESSES))


def read_only(root: str) -> None:
    """Make a folder read-only with all that is mounted in it, and name this computer anew.

    Raises
    ------
    OSError
        If the system does not do so (Linux from 5.12 on).
    """
    library = libc()
    attributes = (ctypes.c_uint64 * 4)(_READ_ONLY, 0, 0, 0)
    call = [_MOUNT_SETATTR, -100, root.encode(), _RECURSIVE, attributes, ctypes.sizeof(attributes)]
    if library is None or library.syscall(*call):
        raise OSError(ctypes.get_errno(), "mount_setattr")
    if library.sethostname(HOST.encode(), len(HOST)):
        raise OSError(ctypes.get_errno(), "sethostname")


def only_reads() -> bool:
    """Whether every mount that this process sees, /tmp left out, is read-only."""
    with suppress(OSError):
        lines = Path("/proc/self/mountinfo").read_text(encoding="utf-8").splitlines()
        parts = [line.split() for line in lines]
        return all("ro" in each[5].split(",") for each in parts if each[4] != "/tmp")
    return False


def status(key: str) -> str:
    """Return what the kernel says of this process, "" where it says nothing."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith(f"{key}:"):
                return line.partition(":")[2].strip()
    return ""


def libc() -> ctypes.CDLL | None:
    """Return the library of system calls, None where there is no Linux."""
    return ctypes.CDLL(None, use_errno=True) if sys.platform.startswith("linux") else None


if __name__ == "__main__":
    read_only(sys.argv[1])
