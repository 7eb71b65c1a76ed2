"""Write the rows of a run or a study as one table; docs/studies.md explains its columns.

Parquet needs pyarrow: pip install pyarrow.

example:
  flexaxis export results/friction --parquet friction.parquet
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands.answers import answer
from flexaxis.experiments.storage.files import REPORT, spare

HELP = "write the rows of a run or a study as Parquet, CSV, NetCDF or JSON lines"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="DIR")
    form = parser.add_mutually_exclusive_group(required=True)
    for name in ("parquet", "csv", "netcdf", "jsonl"):
        form.add_argument(f"--{name}", type=Path, metavar="FILE")


def main(args: argparse.Namespace) -> int:
    """Export and print the path."""
    from flexaxis.experiments.results import export
    from flexaxis.experiments.results.results import Results
    from flexaxis.experiments.studies.benchmark import inputs

    forms = {
        "parquet": export.export_parquet,
        "csv": export.export_csv,
        "netcdf": export.export_netcdf,
        "jsonl": export.export_jsonl,
    }
    name = next(name for name in forms if getattr(args, name))
    target = getattr(args, name)
    spare([*inputs(args.folder), args.folder / REPORT], target)
    count = forms[name](Results.load(args.folder, whole=True), target)
    return answer(args, {"rows": count, "file": target}, 0, f"{count} rows", target)
