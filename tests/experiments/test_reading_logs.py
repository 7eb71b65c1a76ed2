"""Logs in the formats that exist, and in the ways in which people write tables."""

import h5py
import numpy as np
import pytest
import scipy.io

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.findings import LogError, checked
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.mapping import LogMap, pick
from flexaxis.experiments.logs.read import open_log

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
    "Latin-1": table("time,torque,angle [°]").encode("latin-1"),
    "Windows lines": table(end="\r\n"),
    "semicolons, decimal commas": table("time;torque;angle", ";", ","),
    "tabs, decimal commas": table("time\ttorque\tangle", "\t", ","),
    "bars": table("time|torque|angle", "|"),
    "aligned by blanks": table("  time  torque   angle", "   ", form="{:14.9f}"),
    "blanks, decimal commas": table("time torque angle", " ", ","),
    "comments": "# bench 3\n# second run\n" + after(table(), 100, "# a mark of the operator"),
    "names in a comment, as numpy writes": "# " + table(),
    "percent comments": "% bench 3\n" + table(),
    "preamble of a scope": "Scope;X12\nRate;500\n\n" + table("time;torque;angle", ";", ","),
    "line of units": table("time,torque,angle\ns,Nm,rad"),
    "line of units in brackets": table("time,torque,angle\n[s],[Nm],[rad]"),
    "quoted names": table('"time","torque","angle"'),
    "two heads": "Torque and angle\n\n" + table("time,torque,angle"),
    "slashes": "// bench 3\n" + table(),
    "separator at the end": "\n".join(f"{row}," if row else "" for row in table().split("\n")),
    "separator at the end of rows": "\n".join(
        f"{row}," if row and k else row for k, row in enumerate(table().split("\n"))
    ),
    "last line cut": table() + "0.8,1.",
    "empty lines": after(after(table(), 1, ""), 50, ""),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_tables_however_written(way, tmp_path):
    path, content = tmp_path / "log.csv", WAYS[way]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    log = open_log(path)
    assert tuple(log.columns)[:3] == NAMES
    columns = log.read(NAMES)
    for name, wanted in zip(NAMES, (TIME, TORQUE, ANGLE), strict=True):
        np.testing.assert_allclose(columns[name], wanted, atol=1e-8)


def written(tmp_path, text):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    return open_log(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("head", "units"),
    [
        ("time [ms],torque (mNm),angle [deg]", ("ms", "mNm", "deg")),
        ("time / ms,torque / A,angle / °", ("ms", "A", "°")),
        ("time in ms,torque in Nm,angle in deg", ("ms", "Nm", "deg")),
        ("time,torque,angle\nms,Nm,deg", ("ms", "Nm", "deg")),
    ],
)
def test_units_of_the_header(head, units, tmp_path):
    log = written(tmp_path, table(head))
    assert tuple(log.units[name] for name in NAMES) == units


def test_an_index_in_brackets_is_no_unit(tmp_path):
    log = written(tmp_path, table("time,tau[1],q[3]"))
    assert log.columns.keys() == {"time", "tau[1]", "q[3]"} and not log.units
    with pytest.raises(LogError, match=r"no column 'tau\[3\]'. The columns are time, tau\[1\]"):
        pick(log, checked(LogMap, {"torque": "tau[3]", "angle": "q[3]"}, ""))


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        ("current_mA", 1e-3),
        ("current [mA]", 1e-3),
        ("torque_ma", 1.0),  # a moving average
        ("torque [µNm]", 1e-6),
    ],
)
def test_units_of_a_torque(column, factor, tmp_path):
    log = written(tmp_path, table(f"time,{column},angle"))
    mapping = checked(LogMap, {"torque": column.partition(" ")[0]}, "")
    np.testing.assert_allclose(pick(log, mapping).signals["torque"], TORQUE * factor, atol=1e-12)


def test_counts_of_an_encoder(tmp_path):
    log = written(tmp_path, table())
    mapping = checked(LogMap, {"counts": 4096.0}, "")
    angle = pick(log, mapping).signals["angle"]
    np.testing.assert_allclose(angle, ANGLE * 2 * np.pi / 4096, atol=1e-12)
    with pytest.raises(LogError, match="--counts N"):
        pick(log, checked(LogMap, {"unit": {"angle": "counts"}}, ""))


TWINCAT = """Name\tAxis3\t
File\tC:\\Scope\\Axis3.csv\t
Start\t134250624000000000\tFreitag, 6. März 2026\t09:00:00.000

Name\tMoment\tName\tPosition
Data-Type\tREAL64\tData-Type\tREAL64
SampleTime[ms]\t2\tSampleTime[ms]\t2
Port\t851\tPort\t851

"""


def test_a_head_of_keys_in_front_of_every_signal(tmp_path):
    rows = zip(range(0, 2 * N, 2), TORQUE, range(0, 2 * N, 2), ANGLE, strict=True)
    lines = ["\t".join(f"{x:.9f}".replace(".", ",") for x in row) for row in rows]
    log = written(tmp_path, TWINCAT + "\n".join(lines) + "\n")
    assert [*log.columns] == ["Name", "Moment", "Name#2", "Position"]
    given = {"time": "Name", "unit": {"time": "ms"}}
    raw = pick(log, checked(LogMap, given, ""))
    np.testing.assert_allclose(raw.time, TIME, atol=1e-12)
    np.testing.assert_allclose(raw.signals["angle"], ANGLE, atol=1e-8)


def test_the_line_of_names_can_be_stated(tmp_path):
    text = "time,torque,angle\ncomment,of,somebody\nmore,of,it\n" + table("")
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    assert open_log(tmp_path / "log.csv").columns.keys() == {"more", "of", "it"}
    assert open_log(tmp_path / "log.csv", header=1).columns.keys() == {*NAMES}
    log = written(tmp_path, "a,b,c,d,e\n" + table(""))
    with pytest.raises(LogError, match=r"columns are column1, .* give --header LINE"):
        pick(log, LogMap())


def test_a_table_without_names_has_numbered_columns(tmp_path):
    log = written(tmp_path, table(""))
    assert log.columns.keys() == {"column1", "column2", "column3"}
    np.testing.assert_allclose(log.read(["column2"])["column2"], TORQUE)


def test_empty_cells_are_gaps(tmp_path):
    lines = table().split("\n")
    lines[101] = f"{TIME[100]:.9f},,{ANGLE[100]:.9f}"
    lines[201] = f"{TIME[200]:.9f},NaN,-"
    columns = written(tmp_path, "\n".join(lines)).read(NAMES)
    assert np.isnan(columns["torque"][[100, 200]]).all() and np.isnan(columns["angle"][200])
    assert np.isnan(columns["torque"]).sum() == 2


@pytest.mark.parametrize("separator", ["-", "/"])
def test_stamps_of_date_and_time_are_seconds(separator, tmp_path):
    start = np.datetime64("2026-03-29T01:59:59.900")
    stamps = np.datetime_as_string(start + np.round(TIME * 1e6).astype("timedelta64[us]"))
    stamps = [stamp.replace("-", separator).replace("T", " ") for stamp in stamps]
    rows = [f"{s},{u:.6f},{a:.9f}" for s, u, a in zip(stamps, TORQUE, ANGLE, strict=True)]
    log = written(tmp_path, "\n".join(["// bench 3", "time,torque,angle", *rows]))
    np.testing.assert_allclose(log.read(["time"])["time"], TIME, atol=1e-9)


def test_a_second_log_in_a_file_is_named_and_one_part_can_be_read(tmp_path):
    log = written(tmp_path, table() + table())
    with pytest.raises(LogError, match=rf"row {N}, column time: .time. .*--rows 0:{N}"):
        log.read(NAMES)
    np.testing.assert_allclose(log.read(NAMES, slice(0, N))["torque"], TORQUE, atol=1e-8)


def test_a_column_of_texts_is_no_signal_but_does_no_harm(tmp_path):
    rows = [f"{t:.6f},RUN,{u:.6f},{a:.9f}" for t, u, a in zip(TIME, TORQUE, ANGLE, strict=True)]
    log = written(tmp_path, "\n".join(["time,state,torque,angle", *rows]))
    np.testing.assert_allclose(log.read(["angle"])["angle"], ANGLE, atol=1e-9)
    with pytest.raises(LogError, match="row 0, column state: 'RUN' is not a number"):
        log.read(["state"])
    with pytest.raises(LogError, match=r"no column 'angel'. The columns are time, state"):
        pick(log, checked(LogMap, {"angle": "angel"}, ""))


def test_some_rows_of_a_log_and_what_was_stated(tmp_path):
    written(tmp_path, table())
    record = import_log(tmp_path / "log.csv", torque_is="smooth", rows="100:350").record
    np.testing.assert_allclose(record.angle, ANGLE[100:350], atol=1e-8)
    assert (
        record.versions["torque"] == "smooth" and record.versions["torque_because"] == "as stated"
    )
    with pytest.raises(LogError, match="time has 0 samples"):
        import_log(tmp_path / "log.csv", rows="9:3")


def test_a_key_that_a_map_cannot_have_is_told_of_the_map(tmp_path, capsys):
    path = tmp_path / "bench.toml"
    path.write_text('torque = "J{}_I"\naxes = 1\n', encoding="utf-8")
    written(tmp_path, table())
    assert main(["import", str(tmp_path / "log.csv"), "--map", str(path)]) == 2
    assert "bench.toml: axes: unknown key" in capsys.readouterr().err


def _write_hdf5(path, *, userblock=0, shape=(N,)):
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for name, values in zip(NAMES, (TIME, TORQUE, ANGLE), strict=True):
            file[f"motor/{name}"] = values.reshape(shape)


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
    path = tmp_path / name
    BINARY[name](path)
    log = open_log(path)
    assert log.columns.keys() == {f"motor.{signal}" for signal in NAMES}
    np.testing.assert_array_equal(log.read(["motor.torque"])["motor.torque"], TORQUE)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(LogError, match="cannot be read"):
        open_log(path)


def test_arrays_of_structures_have_the_names_of_their_elements(tmp_path):
    """As dSPACE and Simulink write signals."""
    signals = np.array(
        [("Motor/Torque", TORQUE), ("Motor/phi", ANGLE)], [("Name", object), ("Data", object)]
    )
    scipy.io.savemat(tmp_path / "log.mat", {"rec": {"X": {"Data": TIME}, "Y": signals}})
    log = open_log(tmp_path / "log.mat")
    names = ("rec.X.Data", "rec.Y.Motor/Torque.Data", "rec.Y.Motor/phi.Data")
    assert tuple(log.columns) == names
    np.testing.assert_array_equal(log.read(names[1:2])[names[1]], TORQUE)
