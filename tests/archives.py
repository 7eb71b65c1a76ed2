"""
Build the wheel and the source archive of the last commit: the same bytes whoever does so, and when.

    python tests/archives.py [-o dist]

Times in them are that of the commit (or SOURCE_DATE_EPOCH), files have no owner and the usual
permissions, whatever the checkout and the machine are like. It needs git and setuptools.
"""

import argparse
import gzip
import io
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
BUILD = "from setuptools import build_meta as b; b.build_{0}({1!r})"


def archives(out: Path, root: Path = ROOT) -> list[Path]:
    """Build both into a folder; return their paths."""
    out.mkdir(parents=True, exist_ok=True)
    told = os.environ.get("SOURCE_DATE_EPOCH")
    epoch = int(told or _git(root, "log", "-1", "--format=%ct"))
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(epoch), "PYTHONHASHSEED": "0"}
    built = []
    for what in ("wheel", "sdist"):
        with tempfile.TemporaryDirectory() as folder:
            source, made = Path(folder, "source"), Path(folder, "made")
            _check_out(root, source)
            code = BUILD.format(what, str(made))
            command = [sys.executable, "-c", code]
            subprocess.run(
                command, cwd=source, env=environment, check=True, capture_output=True, umask=0o022
            )
            (path,) = made.iterdir()
            built.append(out / path.name)
            data = path.read_bytes()
            built[-1].write_bytes(data if what == "wheel" else repacked(data, epoch))
    return built


def _git(root: Path, *words: str) -> bytes:
    return subprocess.run(["git", *words], cwd=root, check=True, capture_output=True).stdout


def _check_out(root: Path, place: Path) -> None:
    """Write the files of the last commit: none of what lies about in a checkout besides."""
    with tarfile.open(fileobj=io.BytesIO(_git(root, "archive", "HEAD"))) as tar:
        tar.extractall(place, filter="data")
    for path in place.rglob("*"):  # setuptools copies permissions
        if not path.is_symlink():
            path.chmod(0o755 if path.is_dir() or os.access(path, os.X_OK) else 0o644)


def repacked(data: bytes, epoch: int) -> bytes:
    """Return a .tar.gz with its entries in order, of one time and no owner."""
    packed = io.BytesIO()
    with (
        tarfile.open(fileobj=io.BytesIO(data)) as before,
        gzip.GzipFile(filename="", fileobj=packed, mode="wb", mtime=epoch) as stream,
        tarfile.open(fileobj=stream, mode="w", format=tarfile.GNU_FORMAT) as after,
    ):
        for entry in sorted(before.getmembers(), key=lambda entry: entry.name):
            content = before.extractfile(entry) if entry.isreg() else None
            entry.mtime, entry.pax_headers = epoch, {}
            entry.uid = entry.gid = 0
            entry.uname = entry.gname = ""
            entry.mode = 0o755 if entry.isdir() or entry.mode & 0o100 else 0o644
            after.addfile(entry, content)
    return packed.getvalue()


def main() -> None:
    """Build, and print where."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist")
    for path in archives(parser.parse_args().output):
        print(path)


if __name__ == "__main__":
    main()
