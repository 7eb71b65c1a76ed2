"""A world of its own for a process on Linux: what it sees of the files, and how that is made."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.resources import files
from pathlib import Path

from flexaxis.estimators.sampling.compiler import cache_folder

UNSHARE = ("unshare", "--user", "--map-root-user", "--net", "--mount", "--pid", "--ipc", "--uts",
           "--fork", "--kill-child")  # fmt: skip
SYSTEM = ("/usr", "/bin", "/lib", "/lib64", "/sbin", "/etc/alternatives", "/etc/ld.so.cache",
          "/etc/fonts")  # fmt: skip
DEVICES = ("null", "zero", "random", "urandom")
ROOT = "/sys"
"""Where a world is put together, unseen from outside: it is on every Linux, and nobody needs it."""


def python(module: str) -> list[str]:
    """Return the words that start a module of this package, without what is the user's own."""
    return [sys.executable, "-I", "-B", "-m", f"flexaxis.experiments.board.{module}"]


def permitted() -> bool:
    """Whether this system gives a process a world of its own, with what Python needs in it."""
    if hidden():
        return False
    if not sys.platform.startswith("linux") or shutil.which(UNSHARE[0]) is None:
        return False
    try:
        tried = subprocess.run([*UNSHARE, "true"], capture_output=True, check=False, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return tried.returncode == 0


def hidden() -> list[str]:
    """Return what Python needs and a world could not show: it has a /tmp of its own."""
    return [path for path in _seen() if f"{path}/".startswith("/tmp/")]


def of_user() -> list[str]:
    """Return files and folders of the user, of which nothing may be seen in a world."""
    seen = [Path(path) for path in _seen()]
    found = []
    with suppress(OSError, RuntimeError):
        home = Path.home()
        found += [home] if any(path in home.parents for path in seen) else [*home.iterdir()]
    needed = {parent for path in seen for parent in (path, *path.parents)}
    return [str(path) for path in found if path not in needed]


def world_of(entry: Path) -> Iterator[str]:
    """Yield the lines of a shell that make a world and go on in it."""
    yield f"mount -t tmpfs -o size=16m none {ROOT}"
    for path in _seen():
        yield from _bound(path, f"{ROOT}{path}")
    yield from _bound(str(entry), f"{ROOT}/entry")
    if kept := cache_folder():
        yield from _bound(str(kept), f"{ROOT}/cache")
    yield f"mkdir -p {ROOT}/tmp {ROOT}/proc {ROOT}/dev"
    yield f"mount -t proc proc {ROOT}/proc"
    for name in DEVICES:
        yield f"touch {ROOT}/dev/{name}; mount --bind /dev/{name} {ROOT}/dev/{name}"
    yield shlex.join([*python("shut"), ROOT])
    yield f"mount -t tmpfs -o size=256m none {ROOT}/tmp"
    inside = f"cd /entry; exec {shlex.join(python('child'))}"
    yield f"exec chroot {ROOT} /bin/sh -c {shlex.quote(inside)}"


def _bound(source: str, target: str) -> Iterator[str]:
    there, here = shlex.quote(source), shlex.quote(target)
    if Path(source).is_file():
        yield f"mkdir -p {shlex.quote(str(Path(target).parent))}; touch {here}"
    else:
        yield f"mkdir -p {here}"
    yield f"mount --rbind {there} {here}"


def _seen() -> list[str]:
    """Return the folders that Python and its libraries need, those inside others left out."""
    ours = [files(f"flexaxis.{part}") for part in ("models_mjcf", "sim", "estimators")]
    ours.append(files("flexaxis.experiments"))
    wanted = [*SYSTEM, sys.prefix, sys.base_prefix, *map(str, ours)]
    wanted += [place for place in sys.path if "site-packages" in place]
    wanted += [str(Path(sys.executable).resolve().parent.parent)]
    paths = sorted({os.path.abspath(place) for place in wanted if os.path.exists(place)}, key=len)
    kept: list[str] = []
    for path in paths:
        if path != "/" and not any(path.startswith(f"{other}/") for other in kept):
            kept.append(path)
    return kept
