"""The report on what a folder holds, of a run or of a study."""

from __future__ import annotations

from pathlib import Path

from flexaxis.experiments.reporting.study.page import write_report
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.storage.names import CURVES, REPORT, STUDY, SUMMARY
from flexaxis.experiments.storage.schema import row_files
from flexaxis.experiments.studies.benchmark import finish


def report(folder: Path, means: Means | None = None) -> Path:
    """Write report.html into a folder with rows, of a study or of a run, and return its path.

    A study without axes is a run, and gets the summary and the report of one.

    Parameters
    ----------
    folder : Path
    means : Means, optional
        With what a run is swept over its knobs, as far as that is not done.

    Raises
    ------
    StudyError
        If the folder is of neither.
    OutputError
        If it cannot be written.
    """
    if read_study(folder)["axes"]:
        return write_report(Results.load(folder))
    finish(folder, means)
    return folder / REPORT


def inputs(folder: Path) -> list[Path]:
    """Return the files in a folder that a report or an export is made of."""
    return [*(folder / name for name in (STUDY, SUMMARY, CURVES)), *row_files(folder)]
