"""
Names of machine code: no two functions of different processes have the same one.

numba names a function after its place in the source, its types, and a number that every process
counts from one. Two functions of one factory, made for different patterns and compiled in
different processes, so have one name where the numbers meet; a third process that loads both from
the cache folder then calls the first in the place of the second.
"""

import os
import secrets
from functools import lru_cache
from itertools import count
from typing import Any

BITS = 60  # of where a process begins: of 10⁴ that count to 1000, two meet with 10⁻⁷


@lru_cache
def distinct() -> bool:
    """Let this process, and each fork of it, count from where no other does; return if it can."""
    from numba.core import bytecode

    identity: Any = getattr(bytecode, "FunctionIdentity", None)
    if not hasattr(identity, "_unique_ids"):
        return False  # another numba, of which nothing is known

    def begin() -> None:
        identity._unique_ids = count(secrets.randbits(BITS))

    begin()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=begin)
    return True
