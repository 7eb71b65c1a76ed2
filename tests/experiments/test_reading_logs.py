"""Logs in the formats that there are, and in the ways in which people write tables."""

import re

import h5py
import numpy as np
import pytest
import scipy.io

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.mapping import load_mapping, mapping_from, pick
from flexaxis.experiments.logs.reading import csv_file
from flexaxis.experiments.logs.reading.csv_layout import layout_of
from flexaxis.experiments.logs.reading.log import LARGEST, Log, open_log
from flexaxis.sim.record import load_record

N = 400
rng = np.random.default_rng(0)
TIME = np.arange(N) / 500
TORQUE = np.round(rng.standard_normal(N), 6)
ANGLE = np.round(np.cumsum(np.cumsum(TORQUE)) * 1e-4, 9)
NAMES = ("time", "torque", "angle")


def table(head="time,torque,angle", separator=",", decimal=".", end="\n", form="{:.9f}"):
    rows = (
        separator.join(form.format(v) for v in row) for row in zip(TIME, TORQUE, ANGLE, strict=True)
    )
    text = end.join([head, *rows] if head else rows) + end
    return text.replace(".", decimal) if decimal != "." else text


def after(text, line, new):
    lines = text.split("\n")
    return "\n".join([*lines[:line], new, *lines[line:]])


WAYS = {
    "plain": table(),
    "with a mark of UTF-8": b"\xef\xbb\xbf" + table().encode(),
    "UTF-16": table().encode("utf-16"),
    "UTF-16 without a mark": table().encode("utf-16-le"),
    "Latin-1": table("time,torque,angle [°]").encode("latin-1"),
    "Windows lines": table(end="\r\n"),
    "semicolons, decimal commas": table("time;torque;angle", ";", ","),
    "tabs, decimal commas": table("time\ttorque\tangle", "\t", ","),
    "bars": table("time|torque|angle", "|"),
    "aligned by blanks": table("  time  torque   angle", "   ", form="{:14.9f}"),
    "blanks, decimal commas": table("time torque angle", " ", ","),
    "blanks after commas": table("time, torque, angle", ", "),
    "comments": "# bench 3\n# second run\n" + after(table(), 100, "# a mark of the operator"),
    "names in a comment, as numpy writes": "# " + table(),
    "percent comments": "% bench 3\n" + table(),
    "preamble of a scope": "Scope;X12\nRate;500\n\n" + table("time;torque;angle", ";", ","),
    "line of units": table("time,torque,angle\ns,Nm,rad"),
    "line of units in brackets": table("time,torque,angle\n[s],[Nm],[rad]"),
    "quoted names": table('"time","torque","angle"'),
    "separator at the end": "\n".join(f"{row}," if row else "" for row in table().split("\n")),
    "separator at the end of rows": "\n".join(
        f"{row}," if row and k else row for k, row in enumerate(table().split("\n"))
    ),
    "exponents of Fortran": table(form="{:.15e}").replace("e", "D").replace("timD", "time").replace(
        "torquD", "torque").replace("anglD", "angle"),
    "last line cut": table() + "0.8,1.",
    "empty lines": after(after(table(), 1, ""), 50, ""),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_tables_however_written(way, tmp_path):
    path, content = tmp_path / "log.csv", WAYS[way]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    log = open_log(path)
    assert log.names[:3] == NAMES
    columns = log.load(NAMES)
    for name, wanted in zip(NAMES, (TIME, TORQUE, ANGLE), strict=True):
        np.testing.assert_allclose(columns[name], wanted, atol=1e-8)


def test_units_of_the_header(tmp_path):
    path = tmp_path / "log.csv"
    heads = {
        "time [ms],torque (mNm),angle [deg]": ("ms", "mNm", "deg"),
        "time / ms,torque / A,angle / °": ("ms", "A", "°"),
        "time in ms,torque in Nm,angle in deg": ("ms", "Nm", "deg"),
        "time,torque,angle\nms,Nm,deg": ("ms", "Nm", "deg"),
    }
    for head, units in heads.items():
        path.write_text(table(head), encoding="utf-8")
        assert tuple(open_log(path).units[name] for name in NAMES) == units, head


@pytest.mark.parametrize(
    ("column", "unit", "factor"),
    [
        ("current_mA", None, 1e-3),
        ("current [mA]", None, 1e-3),
        ("current", "mA", 1e-3),
        ("torque_ma", None, 1.0),  # a moving average
    ],
)
def test_a_current_in_milliamperes(column, unit, factor, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(table(f"time,{column},angle"), encoding="utf-8")
    given = {"unit": {"torque": unit}} if unit else {}
    mapping = mapping_from({"torque": column.partition(" ")[0]} | given, source="")
    np.testing.assert_allclose(pick(open_log(path), mapping).torque, TORQUE * factor, atol=1e-9)


def test_a_table_without_names_has_numbered_columns(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(table(""), encoding="utf-8")
    log = open_log(path)
    assert log.names == ("column1", "column2", "column3")
    np.testing.assert_allclose(log.load(["column2"])["column2"], TORQUE)


def test_empty_cells_are_gaps(tmp_path):
    path = tmp_path / "log.csv"
    lines = table().split("\n")
    lines[101] = f"{TIME[100]:.9f},,{ANGLE[100]:.9f}"
    lines[201] = f"{TIME[200]:.9f},NaN,-"
    path.write_text("\n".join(lines), encoding="utf-8")
    columns = open_log(path).load(NAMES)
    assert np.isnan(columns["torque"][[100, 200]]).all() and np.isnan(columns["angle"][200])
    assert np.isnan(columns["torque"]).sum() == 2


def test_stamps_of_date_and_time_are_seconds(tmp_path):
    path = tmp_path / "log.csv"
    start = np.datetime64("2026-03-29T01:59:59.900")
    stamps = start + np.round(TIME * 1e6).astype("timedelta64[us]")
    rows = [f"{s},{u:.6f},{a:.9f}" for s, u, a in zip(stamps, TORQUE, ANGLE, strict=True)]
    path.write_text("\n".join(["time,torque,angle", *rows]), encoding="utf-8")
    np.testing.assert_allclose(open_log(path).load(["time"])["time"], TIME, atol=1e-9)


def test_three_thousand_columns(tmp_path):
    path = tmp_path / "log.csv"
    more = [f"ch{k}" for k in range(3000)]
    tail = ",".join(["1.5"] * 3000)
    rows = [f"{t:.6f},{u:.6f},{a:.9f},{tail}" for t, u, a in zip(TIME, TORQUE, ANGLE, strict=True)]
    path.write_text("\n".join([",".join([*NAMES, *more]), *rows]), encoding="utf-8")
    log = open_log(path)
    assert len(log.names) == 3003
    np.testing.assert_allclose(log.load(["angle"])["angle"], ANGLE)
    with pytest.raises(LogError, match=r"and 2963 more"):
        log.load(["angel"])


def test_a_column_of_texts_is_no_signal_but_does_no_harm(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{t:.6f},RUN,{u:.6f},{a:.9f}" for t, u, a in zip(TIME, TORQUE, ANGLE, strict=True)]
    path.write_text("\n".join(["time,state,torque,angle", *rows]), encoding="utf-8")
    log = open_log(path)
    assert set(log.numbers()) == set(NAMES)
    with pytest.raises(LogError, match="line 2, column state: 'RUN' is not a number"):
        log.load(["state"])


def test_names_that_occur_twice(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(table("time,i,i"), encoding="utf-8")
    assert open_log(path).names == ("time", "i", "i#2")


def test_parquet(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    columns = {"time [s]": TIME, "torque [Nm]": TORQUE, "angle [deg]": ANGLE, "state": ["x"] * N}
    parquet.write_table(pyarrow.table(columns), tmp_path / "log.parquet")
    log = open_log(tmp_path / "log.parquet")
    assert log.names == NAMES and log.units["angle"] == "deg"
    np.testing.assert_array_equal(log.load(["torque"])["torque"], TORQUE)


def test_formats_that_need_more_say_what_to_install(tmp_path, monkeypatch):
    import sys

    (tmp_path / "log.parquet").write_bytes(b"PAR1")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(LogError, match="pip install pyarrow"):
        open_log(tmp_path / "log.parquet")


def test_several_axes_of_one_file_and_some_of_its_rows(tmp_path):
    from flexaxis.experiments.cli import main

    k = np.arange(1000)
    rng = np.random.default_rng(0)
    columns = {"t": k * 1e-3} | {f"{n}_{i}": rng.standard_normal(1000) for n in "uv" for i in "12"}
    text = ",".join(columns) + "\n"
    text += "\n".join(
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
    )
    (tmp_path / "log.csv").write_text(text)
    words = [
        "--time",
        "t",
        "--torque",
        "u_{}",
        "--speed",
        "v_{}",
        "--axis",
        "2",
        "--rows",
        "100:900",
    ]
    assert main(["import", str(tmp_path / "log.csv"), *words]) == 0
    record = load_record(tmp_path / "log.nc")
    assert len(record.time) == 800
    np.testing.assert_allclose(record.speed, columns["v_2"][100:900], rtol=1e-6)
    assert main(["import", str(tmp_path / "log.csv"), *words[:-1], "9:3"]) == 2


def test_irregular_stamps_are_resampled_with_a_warning(tmp_path):
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.choice([1.2e-3, 2.86e-3, 5e-3], 3000))
    u = np.sin(2 * np.pi * 3 * t)
    rows = "\n".join(
        f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(t, u, np.cos(7 * t), strict=True)
    )
    (tmp_path / "log.csv").write_text(f"time,torque,speed\n{rows}\n")
    found = import_log(tmp_path / "log.csv", {"torque_is": "smooth"})
    (stamps,) = [c for c in found.checks if c.name == "time stamps"]
    assert stamps.kind == "note" and "interpolated" in stamps.text
    record = found.record
    assert record.period == pytest.approx(2.86e-3, rel=1e-3)
    np.testing.assert_allclose(record.speed, np.cos(7 * record.time), atol=1e-3)


def test_what_was_stated_is_kept_with_the_record(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(table(), encoding="utf-8")
    told = import_log(path, {"torque_is": "smooth"}).record.versions
    assert told["torque"] == "smooth" and told["torque_because"].startswith("as stated")
    guessed = import_log(path, {}).record.versions
    assert guessed["torque"] == "held" and not guessed["torque_because"].startswith("as stated")


def test_a_log_reads_what_is_asked_for():
    asked = []

    def read(names, *, strict=True):
        asked.extend(names)
        return {name: TIME for name in names}

    Log("log", ("a", "b", "c"), read).load(["b"])
    assert asked == ["b"]


def test_numbers_are_read_to_the_last_digit(tmp_path):
    values = np.random.default_rng(0).standard_normal(N)
    rows = (f"{t!r},{v!r}" for t, v in zip(TIME.tolist(), values.tolist(), strict=True))
    (tmp_path / "log.csv").write_text("\n".join(["time,torque", *rows]) + "\n", encoding="utf-8")
    found = open_log(tmp_path / "log.csv").read(["torque"])["torque"]
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize("version", ["2.2.2", "2.3.0+4.gabc", "3.0.1", "3.0rc0"])
def test_a_pandas_that_rounds_otherwise_is_told_not_to(version):
    assert csv_file._to_the_last_digit(version) == {"float_precision": "round_trip"}


@pytest.mark.parametrize("version", ["3.1.1", "3.1rc0", "4.0.0.dev0+12", "0+unknown", "3"])
def test_a_pandas_that_warns_of_being_told_is_not(version):
    assert csv_file._to_the_last_digit(version) == {}


def test_a_key_that_a_map_cannot_have_is_told_of_the_map(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text('torque = "J{}_I"\naxis = 1\n', encoding="utf-8")
    with pytest.raises(LogError, match=r"bench\.toml: axis: no such key"):
        load_mapping(path)


def test_a_line_with_another_number_of_cells_is_named_as_it_is_counted_in_the_file(tmp_path):
    path = tmp_path / "log.csv"
    lines = ["time,torque,speed", "0,1,2,3", *(f"{k},1,2" for k in range(1, 9))]
    path.write_text("\n".join(lines))
    with pytest.raises(LogError, match="line 2 has 4 cells"):
        layout_of(path)


def _write_hdf5(path, *, userblock=0, shape=(N,)):
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for name, values in zip(NAMES, (TIME, TORQUE, ANGLE), strict=True):
            file[f"motor/{name}"] = values.reshape(shape)
        file["motor/torque"].attrs["units"] = "Nm"


def _write_mat73(path):
    """MATLAB puts a block of text before HDF5, and rows where others have columns."""
    _write_hdf5(path, userblock=512, shape=(1, N))
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(128))


def _write_mat(path):
    signals = dict(zip(NAMES, (TIME, TORQUE, ANGLE), strict=True))
    scipy.io.savemat(path, {"motor": signals, "note": "bench 3"})


BINARY = {"log.h5": _write_hdf5, "log73.mat": _write_mat73, "log.mat": _write_mat}


@pytest.mark.parametrize("name", BINARY)
def test_columns_of_groups_and_structures(name, tmp_path):
    BINARY[name](tmp_path / name)
    log = open_log(tmp_path / name)
    assert set(log.names) == {f"motor.{signal}" for signal in NAMES}
    np.testing.assert_array_equal(log.load(["motor.torque"])["motor.torque"], TORQUE)


@pytest.mark.parametrize("name", BINARY)
def test_a_damaged_file_is_one_clear_error(name, tmp_path):
    path = tmp_path / name
    BINARY[name](path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(LogError, match=re.escape(str(path))):
        open_log(path)


def test_a_file_larger_than_memory_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.truncate(LARGEST + 1)
    with pytest.raises(LogError, match="larger than 8 GB"):
        open_log(path)
