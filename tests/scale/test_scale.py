"""Four times the rows take about four times as long, and hardly more memory."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import synthetic

pytestmark = pytest.mark.slow
ROWS = (25_000, 100_000)  # above what stays in memory
BYTES = 400  # of memory a row: as many columns at a time as `groups.HELD` allows, and some numbers


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two studies, and what opening one takes: with imports, and no rows read."""
    home = tmp_path_factory.mktemp("scale")
    made = [home / str(rows) for rows in ROWS]
    for folder, rows in zip(made, ROWS, strict=True):
        synthetic.make(folder, rows)
    return made, synthetic.measure(made[1], "open")


@pytest.mark.parametrize("what", ["columns", "report", "summary", "csv", "parquet", "netcdf"])
def test_time_and_memory_grow_with_the_rows_and_no_faster(folders, what):
    if what == "parquet":
        pytest.importorskip("pyarrow", reason="the extra `parquet`")
    made, (_, before, base) = folders
    few, many = (synthetic.measure(folder, what) for folder in made)
    # Processor time: the clock knows of others. What does not grow with the rows only helps.
    assert many[1] - before < 2 * 4 * max(0.5, few[1] - before)
    assert many[1] - before < ROWS[1] * 60e-6 * 3  # 60 s a million, and others at work beside us
    assert many[2] - few[2] < (ROWS[1] - ROWS[0]) * BYTES / 1e6 + 20
    assert many[2] < base + 250
