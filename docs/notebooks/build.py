"""Build each notebook NAME.ipynb in this folder from the source file NAME.py.

In a source file, the line `# %%` starts a cell. The script runs each notebook from top to bottom in
an empty folder, and stores the notebook with the printed output and the figures. The script omits
progress messages and paths, so a new build of an unchanged notebook differs only in the figures.

    python docs/notebooks/build.py [NAME …]
"""

from __future__ import annotations

import base64
import io
import os
import sys
import tempfile
import time
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image

HERE = Path(__file__).parent
SOURCES = sorted(path for path in HERE.glob("*.py") if path.name != Path(__file__).name)
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
PLAIN = {
    "OMP_NUM_THREADS": "1",
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "NO_COLOR": "1",
    "COLUMNS": "110",
}
LIMIT = 300  # time limit of one cell [s]; a whole notebook takes less than a minute on an idle core
COLOURS = 96  # number of colours in a stored figure; enough for lines and bands


def source(path: Path) -> NotebookNode:
    """Read a source file, and return the notebook without output."""
    book = jupytext.read(path)
    for place, cell in enumerate(book.cells):
        cell["id"], cell["metadata"] = f"cell-{place}", {}
    book["metadata"] = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    return book


def run(path: Path, folder: Path) -> NotebookNode:
    """Run a notebook source file in a folder, and return the notebook with the output."""
    book, inside = source(path), dict(os.environ)
    os.environ.update(PLAIN)
    # In a notebook, `!flexaxis` must run the program of this Python environment.
    os.environ.update(PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    try:
        where = {"metadata": {"path": folder}}
        NotebookClient(
            book, timeout=LIMIT, kernel_name=KERNEL["name"], resources=where, coalesce_streams=True
        ).execute()
    finally:
        os.environ.clear()
        os.environ.update(inside)
    for cell in book.cells:
        cell["metadata"] = {}
        if cell.cell_type == "code":
            cell["outputs"] = [_small(out) for out in cell.outputs if not _is_progress(out)]
    book["metadata"] = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    return book


def _is_progress(output: NotebookNode) -> bool:
    if output.output_type == "stream":
        return bool(output.name == "stderr")
    return output.get("data", {}).get("text/plain", "-") == ""  # a progress line that was erased


def _small(output: NotebookNode) -> NotebookNode:
    """Return a cell output with normalised line endings, and with fewer colours in figures."""
    if output.output_type == "stream":
        output["text"] = output.text.replace("\r\n", "\n")
    data = output.get("data", {})
    if "image/png" in data:
        picture = Image.open(io.BytesIO(base64.b64decode(data["image/png"]))).convert("RGB")
        file = io.BytesIO()
        picture.quantize(COLOURS, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
        data["image/png"] = base64.b64encode(file.getvalue()).decode() + "\n"
        data.pop("text/plain", None)
    return output


def main(names: list[str]) -> None:
    """Run and write the named notebooks, or all notebooks if no names are given."""
    for path in [p for p in SOURCES if not names or p.stem in names]:
        begun = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            book = run(path, Path(folder))
        nbformat.write(book, path.with_suffix(".ipynb"))
        size = path.with_suffix(".ipynb").stat().st_size / 1000
        print(f"{path.stem}.ipynb: {time.monotonic() - begun:.0f} s, {size:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
