"""Where compiled code is kept: in files named after all that it is made from, or nowhere."""

import gc
import hashlib
import os
import pickle
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

FORM = 2  # of the files: in the first, names of different functions could be the same
TOLD = 1.0  # s of waiting for another process after which the user hears of it
PATIENCE = 60.0  # s, longer than a loop takes to compile: who holds it then may have been stopped
PAUSE = 0.02  # s between two looks


class Nowhere:
    """A cache for where nothing can be written: says what is being compiled, keeps nothing."""

    cache_path = None
    _told: "Nowhere | None" = None  # of the outermost compilation the user is told
    _collecting = True

    def __init__(self, label: str, where: str = "as no cache folder can be written") -> None:
        self.label, self.where = label, where

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Find nothing, and tell the user what follows from it."""
        if Nowhere._told is None:
            print(f"flexaxis: compiling {self.label} {self.where} …", file=sys.stderr, flush=True)
            Nowhere._told = self
            Nowhere._collecting = gc.isenabled()
            gc.disable()  # looking for garbage takes a sixth of the time, and finds next to none

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep nothing."""
        self.ended()

    def ended(self) -> None:
        """Know that the compiler has ended, with or without a result."""
        if Nowhere._told is self:
            Nowhere._told = None
            if Nowhere._collecting:
                gc.enable()

    def enable(self) -> None: ...  # noqa: D102

    def disable(self) -> None: ...  # noqa: D102


class Store(Nowhere):
    """
    Compiled code in files; in place of numba's cache.

    What another process is compiling is waited for, though not for ever.

    Parameters
    ----------
    function : flexaxis.estimators.sampling.compiler.Compiled
    folder : Path
    """

    def __init__(self, function: Any, folder: Path) -> None:
        super().__init__(function.label, f"once, into {folder}")
        self.function, self.folder = function, folder
        self._claim: IO[bytes] | None = None

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return what is kept, or None."""
        context.refresh()
        found = self._read(signature, context)
        if found is None:
            self._claim = _claimed(self.path(signature, context.codegen()), self.label)
            found = self._read(signature, context) if self._claim else None
        if found is None:
            return super().load_overload(signature, context)
        self._release()
        return found

    def _read(self, signature: Any, context: Any) -> Any:
        from numba.core.compiler import CompileResult

        # a file that is missing, torn or of another kind must stop nobody
        with suppress(Exception):
            path = self.path(signature, context.codegen())
            _refuse_others(path)
            content = path.read_bytes()
            return CompileResult._rebuild(context, *pickle.loads(content))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write what has been compiled."""
        from numba.core.serialize import dumps

        path = self.path(signature, result.codegen)
        aside = path.with_suffix(f".{os.getpid()}")
        try:
            aside.write_bytes(dumps(result._reduce()))
            os.replace(aside, path)
        except OSError:  # a full disk: it will have to be compiled again
            with suppress(OSError):
                aside.unlink(missing_ok=True)
        self.ended()

    def ended(self) -> None:
        """Let others go on who wait for the result."""
        super().ended()
        self._release()

    def _release(self) -> None:
        if self._claim is not None:
            with suppress(OSError):
                os.unlink(self._claim.name)
            self._claim.close()
            self._claim = None

    def path(self, signature: Any, codegen: Any) -> Path:
        """Return the file of what is compiled for these types."""
        import numba

        versions = FORM, numba.__version__, sys.version_info[:3]  # and the machine, in the magic
        kind = repr((self.function.digest, str(signature), codegen.magic_tuple(), versions))
        digest = hashlib.sha256(kind.encode()).hexdigest()[:24]
        return self.folder / f"{self.function.name}-{digest}.nbc"


def _claimed(path: Path, label: str) -> IO[bytes] | None:
    """
    Return what nobody else holds until it is closed, or its holder has died; first wait for it.

    None where files cannot be locked, and after `PATIENCE` seconds, as the holder may have been
    stopped: several processes may then compile the same.
    """
    try:
        import fcntl

        claim = path.with_suffix(".claim").open("ab")
    except (ImportError, OSError):
        return None
    began, told = time.monotonic(), False
    while (waited := time.monotonic() - began) <= PATIENCE:
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if waited > TOLD and not told:
                words = f"flexaxis: waiting for another process to compile {label} …"
                print(words, file=sys.stderr, flush=True)
                told = True
            time.sleep(PAUSE)
        except OSError:
            break
        else:
            return claim
    claim.close()
    return None


def _refuse_others(path: Path) -> None:
    """Raise where a file is another user's: it holds code, and a folder may be shared."""
    if hasattr(os, "getuid") and path.stat().st_uid not in {0, os.getuid()}:
        raise PermissionError(f"{path} belongs to another user")
