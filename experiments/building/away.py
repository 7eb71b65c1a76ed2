"""A user's code in a process of its own: whatever it does there, this one goes on.

A module has one process for as long as it is used. What is asked of it is a function of ours, of
the class or of what was made of it. Numbers, texts and tables come back as they are, an object of a
user's class as the values that it has.
"""

from __future__ import annotations

import inspect
import io
import os
import pickle
import sys
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from itertools import count
from types import SimpleNamespace
from typing import Any, cast

from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import theta_of
from flexaxis.experiments.building import guest
from flexaxis.experiments.building.code import remember
from flexaxis.experiments.building.crashes import EstimatorCrash, described, is_its_own
from flexaxis.experiments.building.imports import class_of
from flexaxis.experiments.building.processes import Workers

GRACE = 60.0  # s after its limit, in which it is told where it is, on a busy machine, too
MOST = 8  # processes that are kept for what is asked next
Call = Callable[..., Any]
KEPT = 64  # estimators, the last that were asked for
What = tuple[str, str, str] | int
"""A class by its module, its whole name and its own; an estimator by its number."""


class Died(EstimatorCrash):
    """The process of a user's code has ended: by what it does, or by the system."""


_DIED = "its process died: its code ended it, memory ran out, or it was killed"
_running = OrderedDict[tuple[str, str, int], Workers]()
_numbers = count()


class Away:
    """What lives in the process of a user's code, as if it were here: a class, or an estimator.

    Parameters
    ----------
    module, text : str
        Its module, and what it is called in messages.
    what : tuple of str, or int
        As `_answer` takes it.

    Attributes
    ----------
    spent : float
        Time of its thread that it has taken so far [s].
    """

    __signature__: inspect.Signature

    def __init__(self, module: str, text: str, what: What) -> None:
        self._module, self.text, self._what, self.spent = module, text, what, 0.0
        self._own = self._shared() if isinstance(what, int) else None  # where it is kept

    def _shared(self) -> Workers:
        """Return the process of the module, a new one where there is none."""
        folder = ""
        with suppress(OSError):  # it was removed
            folder = os.getcwd()
        key = self._module, folder, os.getpid()
        if key not in _running:
            remember(self.text)
            _running[key] = Workers(1, _begin)
            if len(_running) > MOST:
                _running.popitem(last=False)
        _running.move_to_end(key)
        return _running[key]

    def there(self, function: Call, *args: Any, doing: str = "when it was asked") -> Any:
        """Return what a function of ours gives of it, where it is.

        Raises
        ------
        EstimatorError
            As from `guest.hosted`.
        Died
            If the process ends.
        """
        told, left = guest.asked(self.text, doing)
        asked = told, guest.time_limit(), self._what, function, args
        workers = self._own or self._shared()
        try:
            answer = workers.submit(_answer, asked).result(left + GRACE)
        except BaseException as error:
            workers.end(killed=True)
            for key in [key for key, each in _running.items() if each is workers]:
                del _running[key]
            if not isinstance(error, TimeoutError | BrokenExecutor):
                raise
            late = isinstance(error, TimeoutError)
            why = f"TimeoutError: {guest.no_end()}" if late else _DIED
            crashed = (EstimatorCrash if late else Died)(f"{told.text} crashed {told.doing}: {why}")
            raise guest.complete(crashed) from None
        raised, value, seconds = pickle.loads(answer)
        if raised is not None:
            raise raised
        self.spent += seconds
        return value

    def __call__(self, maker: Call, spec: Any, *args: Any) -> Away:
        """Return what a function of ours makes there of a `Spec`, whose class this is."""
        made = Away(self._module, spec.text, next(_numbers))
        asked = made._what, maker, replace(spec, make=None), *args
        Away(self._module, spec.text, self._what).there(_keep, *asked, doing="when it was made")
        return made

    def step(self, u: float, y: float | None) -> Any:
        """Return θ[k] (p,)."""
        return self.there(_step, u, y)

    def __getattr__(self, name: str) -> Any:
        """Return what it has under a name; a method as what calls it."""
        kind, found = ("", None) if name.startswith("_") else self.there(_attribute, name)
        if not kind:
            raise AttributeError(name)
        if name in {"names", "output"}:  # which do not change
            setattr(self, name, found)
        return partial(self.there, _call, name) if kind == "method" else found


def there(function: Call, estimator: Any, *args: Any) -> Any:
    """Return what a function gives of an estimator, called where the estimator is."""
    away = isinstance(estimator, Away)
    return estimator.there(function, *args) if away else function(estimator, *args)


# The other end, in the process of the code.

_KNOWN = sys.stdlib_module_names | {"flexaxis", "numpy"}
_kept = OrderedDict[int, Any]()


def _begin() -> None:
    """Make this process that of a user's code."""
    os.dup2(2, 1)
    guest.stay()


def _answer(asked: tuple[guest.Told, float, What, Call, Any]) -> bytes:
    """Return what a function gives of a class or an estimator, as error, value and time [s]."""
    told, limit, what, function, args = asked
    start = time.thread_time()
    try:
        host = nullcontext() if function is _keep else guest.hosted(**told._asdict())
        with guest.limited(limit), host:  # what is kept is hosted where it is made
            value = function(_found(what), *args)
        return _packed((None, value, time.thread_time() - start))
    except BaseException as raised:
        ours = type(raised).__module__.startswith("flexaxis.")
        known = ours and isinstance(raised, EstimatorError)
        error = cast(EstimatorError, raised) if known else EstimatorError(described(raised))
        error.add_note("".join(traceback.format_exception(raised)))
        return _packed((guest.complete(error, outside=not is_its_own(raised)), None, 0.0))


def _found(what: What) -> Any:
    if not isinstance(what, int):
        return class_of(*what)
    if what not in _kept:
        raise EstimatorError(
            "the process in which it was made has ended, or has made many since: make it anew"
        )
    _kept.move_to_end(what)
    return _kept[what]


class _Pickler(pickle.Pickler):
    def reducer_override(self, found: Any) -> Any:
        """Send what only this process knows as its values."""
        if getattr(found, "__module__", "builtins").partition(".")[0] in _KNOWN:
            return NotImplemented
        values = {name: getattr(found, name, None) for name in dir(found) if name[0] != "_"}
        return _namespace, ({name: each for name, each in values.items() if not callable(each)},)


def _namespace(values: dict[str, Any]) -> SimpleNamespace:
    return SimpleNamespace(**values)


def _packed(content: Any) -> bytes:
    file = io.BytesIO()
    _Pickler(file).dump(content)
    return file.getvalue()


def _keep(found: Call, number: int, maker: Call, spec: Any, *args: Any) -> None:
    """Keep under a number what is made of a class and its options."""
    threadpool_limits(1)  # wherever it is run, to the last bit the same
    _kept[number] = maker(replace(spec, make=found), *args)
    if len(_kept) > KEPT:
        _kept.popitem(last=False)


def _step(estimator: Any, u: float, y: float | None) -> Any:
    """Return θ[k] of a step as numbers."""
    return theta_of(estimator.step(u, y), estimator.names, estimator).tolist()


def _attribute(found: Any, name: str) -> tuple[str, Any]:
    """Return what there is under a name: a value or a method, which stays here, or nothing."""
    try:
        value = getattr(found, name)
    except AttributeError:
        return "", None
    return ("method", None) if callable(value) else ("value", value)


def _call(found: Any, name: str, *args: Any) -> Any:
    """Call a method."""
    return getattr(found, name)(*args)
