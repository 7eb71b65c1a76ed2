"""System calls that a case may not make: those that lead round what shuts it in.

A namespace for network does not hold every kind of socket: one to the host of a virtual machine
(vsock) goes through. A case needs none but those of UNIX and IP, and neither keys, tracing nor
queues of calls (io_uring), through which sockets could be had as well. Linux, seccomp(2).
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct
from collections.abc import Iterator

from flexaxis.experiments.board.shut import libc

_SECCOMP, _FILTER = 22, 2  # of prctl
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06  # of a filter's program
_NUMBER, _MACHINE, _FIRST_ARGUMENT = 0, 4, 16  # where they stand in what it is given
_ALLOWED, _REFUSED = 0x7FFF0000, 0x00050000 | 1  # EPERM
_OTHER_CALLS = 0x40000000  # numbers of another way to call on x86_64

FAMILIES = (1, 2, 10, 16)  # UNIX, IPv4, IPv6, and what is asked about one's own network
HELD_BY_NONE = (21, 31, 40, 42)  # rds, bluetooth, vsock, qipcrtr: no namespace keeps them in

_NEWER = (425, 426, 427, 438)  # io_uring_setup, _enter, _register, pidfd_getfd: the same everywhere
# By machine: how a filter calls it; socket, socketpair; add_key, request_key, keyctl, ptrace,
# process_vm_readv and _writev, perf_event_open, bpf, userfaultfd, unshare, setns, mount,
# open_by_handle_at.
_ANY = (0xC00000B7, (198, 199), (217, 218, 219, 117, 270, 271, 241, 280, 282, 97, 268, 40, 265))
_CALLS = {
    "x86_64": (
        0xC000003E,
        (41, 53),
        (248, 249, 250, 101, 310, 311, 298, 321, 323, 272, 308, 165, 304),
    ),
    "aarch64": _ANY,
    "riscv64": (0xC00000F3, *_ANY[1:]),
}

SIFTED = "2"
"""What the system says of a process, as ``Seccomp``, that has gone through `sift`."""


def sift() -> None:
    """Refuse those calls from now on, to this process and all that it starts.

    It must have given its privileges away. On machines whose numbers are not known here it does
    nothing, which `other_sockets` sees.
    """
    known = _CALLS.get(os.uname().machine)
    if known is None or (library := libc()) is None:
        return
    lines = list(_program(*known))
    program = ctypes.create_string_buffer(b"".join(lines))
    whole = ctypes.create_string_buffer(
        struct.pack("HxxxxxxP", len(lines), ctypes.addressof(program))
    )
    library.prctl(_SECCOMP, _FILTER, whole, 0, 0)


def other_sockets() -> bool:
    """Whether this process has a socket that no namespace holds."""
    return any(map(_opens, HELD_BY_NONE))


def _opens(family: int) -> bool:
    for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM, socket.SOCK_SEQPACKET, socket.SOCK_RAW):
        try:
            socket.socket(family, kind).close()
        except OSError:
            continue
        return True
    return False


def _program(machine: int, sockets: tuple[int, ...], calls: tuple[int, ...]) -> Iterator[bytes]:
    """Yield the instructions: code, lines to leave out if true and if not, value."""

    def line(code: int, value: int, true: int = 0, false: int = 0) -> bytes:
        return struct.pack("HBBI", code, true, false, value)

    yield line(_LOAD, _MACHINE)
    yield line(_EQUAL, machine, true=1)
    yield line(_RETURN, _REFUSED)
    yield line(_LOAD, _NUMBER)
    yield line(_AT_LEAST, _OTHER_CALLS, false=1)
    yield line(_RETURN, _REFUSED)
    for number in (*calls, *_NEWER):
        yield line(_EQUAL, number, false=1)
        yield line(_RETURN, _REFUSED)
    yield line(_EQUAL, sockets[0], true=2)
    yield line(_EQUAL, sockets[1], true=1)
    yield line(_RETURN, _ALLOWED)
    yield line(_LOAD, _FIRST_ARGUMENT)
    for family in FAMILIES:
        yield line(_EQUAL, family, false=1)
        yield line(_RETURN, _ALLOWED)
    yield line(_RETURN, _REFUSED)
