"""Write a template for a new estimator, and list the commands to run next."""

from importlib.resources import files
from pathlib import Path

from flexaxis.experiments.files import write_text
from flexaxis.sim.errors import FlexaxisError

TEMPLATES = {
    ".py": ("my_estimator.py",),
    ".c": ("my_estimator.c", "flexaxis.h"),
    ".m": ("my_estimator.m",),
}
"""Files of each template, keyed by file suffix; the function `new` renames the first file."""


def new(path: Path) -> list[str]:
    """Write a working template estimator to a file, and return the commands to run next.

    Parameters
    ----------
    path : Path
        Path of the new file. The file suffix selects the programming language: Python (.py), C (.c)
        or GNU Octave (.m).

    Raises
    ------
    FlexaxisError
        If the file name is invalid, or if the file already exists.
    """
    if path.suffix not in TEMPLATES or not path.stem.isidentifier():
        raise FlexaxisError(
            f"{path}: choose a file name of letters, digits and underscores, with the suffix .py, "
            ".c or .m, such as my_estimator.py, my_estimator.c or my_estimator.m"
        )
    if path.exists():
        raise FlexaxisError(f"{path} already exists; choose another file name")
    home = files("flexaxis.experiments.check") / "templates"
    for name in TEMPLATES[path.suffix]:
        text = (home / name).read_text(encoding="utf-8")
        target = path if name.startswith("my_") else path.with_name(name)
        write_text(target, text.replace("my_estimator", path.stem))
    text = {".py": "{}:Mine", ".m": "'pipe:octave-cli -q {}'", ".c": "pipe:./{}"}[path.suffix]
    now = text.format(path.with_suffix("") if path.suffix == ".c" else path)
    lines = [f"cc -O2 -o {path.with_suffix('')} {path} -lm"] * (path.suffix == ".c")
    lines += [f"flexaxis check {now}",
              f"flexaxis compare --base rpem-forgetting --candidate {now} fm_step"]  # fmt: skip
    return lines
