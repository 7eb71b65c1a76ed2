"""What tells code, data and libraries from any others: the digests of tables and of stages."""

import ast
import hashlib
import re
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from importlib.metadata import distributions, version
from io import BytesIO
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ("models_mjcf", "sim", "estimators", "experiments")
NOT = ":(exclude)"
# What a table on own logs may be made of. Left out are what begins and ends a command or a process
# (scores do not depend on how many there are: tests/experiments/test_benchmark.py), and what writes
# the page of a run: no number comes from these.
OF_LOGS = (*PACKAGE, *(f"{NOT}experiments/{name}" for name in (
    "cli.py", "building/interrupts.py", "building/processes.py", "building/worker.py",
    "reporting/assets", "reporting/templates", "reporting/run/first.py",
    "reporting/run/page.py")))  # fmt: skip
# What any other may be made of: scenarios, estimators and scores know nothing of logs.
NUMBERS = (*OF_LOGS, f"{NOT}experiments/logs")
PAGE = "docs/proof.md"


def digest(parts: tuple[str, ...], ref: str = "") -> str:
    """Return what tells files from any others: those here, or those of a commit.

    Of parts that are named code counts without comments and docstrings; of all, "." or no parts,
    the text does.
    """
    total, bare = hashlib.sha256(), bool(parts) and "." not in parts
    for name, content in sorted(_files(parts, ref)):
        if name != PAGE:
            total.update(f"{name}\n".encode() + (_meant(name, content) if bare else content))
    return total.hexdigest()[:10]


def libraries() -> str:
    """Return what tells this Python, and the libraries that numbers are made with, from others."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = sorted(re.match(r"[\w-]+", line)[0] for line in project["dependencies"])
    return _hashed([sys.version.split()[0], *(f"{name} {version(name)}" for name in names)])[:6]


def installed() -> str:
    """Return what tells this Python, and all that is installed, from others."""
    return _hashed([sys.version, *sorted(f"{d.metadata['Name']} {d.version}" for d in
                                         distributions())])  # fmt: skip


def stamp() -> str:
    """Return the digest that stands below a table: of code and data, and of the libraries."""
    return f"{digest(NUMBERS)}-{libraries()}"


def git(*words: str) -> bytes:
    """Return what git answers."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, check=True).stdout


def _hashed(lines: list[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:10]


def _files(parts: tuple[str, ...], ref: str) -> Iterator[tuple[str, bytes]]:
    if ref:
        with tarfile.open(fileobj=BytesIO(git("archive", ref))) as archive:
            for member in archive:  # some of the parts may not be in it yet
                if member.isfile() and _within(member.name, parts):
                    yield member.name, archive.extractfile(member).read()
        return
    listed = git("ls-files", "-co", "--exclude-standard", "-z", "--", *parts).decode()
    for name in listed.split("\0"):
        if (ROOT / name).is_file():
            yield name, (ROOT / name).read_bytes()


def _within(name: str, parts: tuple[str, ...]) -> bool:
    """Return whether a file is in one of the parts, and in none that are left out."""

    def of(part: str) -> bool:
        return part == "." or fnmatch(name, part) or name.startswith(f"{part}/")

    left_out = any(of(part.removeprefix(NOT)) for part in parts if part.startswith(NOT))
    return any(map(of, parts)) and not left_out


@cache
def _meant(name: str, content: bytes) -> bytes:
    """Return a file without what a run does not see: comments and docstrings of code."""
    if not name.endswith(".py"):
        return content
    tree = ast.parse(content)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str):
            del body[0]
    whole = {"show_empty": True} if sys.version_info >= (3, 13) else {}  # as it was before
    return ast.dump(tree, **whole).encode()
