"""MAT files are read in a process of their own; see also test_logs_apart.py."""

from datetime import datetime

import numpy as np
import pytest
import scipy.io

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import mat_file
from flexaxis.experiments.logs.trend.covariates import begun


@pytest.fixture
def log(tmp_path, monkeypatch):
    """A log with a date in it, in a process that would end if it read it itself."""
    path = tmp_path / "log.mat"
    content = {"time": np.arange(9.0), "torque": np.arange(9.0), "date": "2026-02-03 04:05:06"}
    scipy.io.savemat(path, content | {"start": 1.7e9})

    def crash(*_, **__):
        raise SystemExit("as a file that is broken in the right way does")

    monkeypatch.setattr(scipy.io, "loadmat", crash)
    return path


def test_columns_and_dates_come_from_elsewhere(log):
    assert {"time", "torque"} <= set(mat_file.open_file(log).names)
    assert mat_file.texts_of(log, ["date", "start", "none"]) == [
        "2026-02-03 04:05:06",
        "1700000000.000000",
    ]
    assert begun(log) == datetime(2026, 2, 3, 4, 5, 6)


def test_a_broken_one_has_no_date(log):
    log.write_bytes(log.read_bytes()[:150])
    assert begun(log) is None
    with pytest.raises(LogError, match="no MAT file, or a broken one"):
        mat_file.texts_of(log, ["date"])
