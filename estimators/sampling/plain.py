"""
Compile a function by nothing but what numba documents: in the place of `parts` where that fails.

The numbers are the same; it takes longer, as each function is made machine code of by itself.
"""

from collections.abc import Callable
from typing import Any

import numba

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
PART_OPTIONS: dict[str, Any] = OPTIONS | {"no_cpython_wrapper": True}


def whole(function: Callable) -> Any:
    """Return what numba calls a compiled function, for Python to call."""
    return numba.njit(**OPTIONS)(function)


def part(function: Callable, *, inline: bool, alone: bool) -> Any:
    """
    Return the same for compiled code to call.

    Parameters
    ----------
    function : callable
    inline : bool
        Whether it becomes a part of its callers however long it is.
    alone : bool
        Without effect: everything is optimised before its callers take it in.
    """
    return numba.njit(**PART_OPTIONS, forceinline=inline)(function)
