"""Records on disk: what goes in comes out, and whatever is wrong is told."""

import dataclasses
import json
import os
import stat
import subprocess
import sys

import h5netcdf
import h5py
import numpy as np
import pytest

from flexaxis.sim.errors import RecordError
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.record import Record, load_record
from flexaxis.sim.simulate import simulate

FIELDS = [field.name for field in dataclasses.fields(Record)][:11]
ARRAYS = [name for name in FIELDS if name != "true_angle_l"]  # which the paper's axis has not


@pytest.fixture(scope="module")
def record():
    from flexaxis.sim.scenario import parse_scenario

    text = 'name = "x"\nduration = 1.0\n[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 0.5\n'
    return simulate(parse_scenario(text + "factor = 1.5"), [3])[0]


@pytest.fixture
def own():
    """Return arrays of a log from outside, and how to write them as NetCDF by hand."""
    time = np.arange(100) * 0.01
    return {"time": time, "torque": np.sin(time), "speed": np.cos(time)}


def write(path, arrays, **attributes):
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": 100}
        for name, values in arrays.items():
            file.create_variable(name, ("time",), data=values)
        file.attrs.update(attributes)
    return path


def test_round_trip_is_byte_identical(record, tmp_path):
    path = record.save(tmp_path / "run.nc")
    again = load_record(path)
    for name in ARRAYS:
        assert getattr(again, name).tobytes() == getattr(record, name).tobytes(), name
    for name in ("scenario", "hash", "seed", "burn_in", "versions"):
        assert getattr(again, name) == getattr(record, name), name
    assert again.valid is None and again.period == 0.005


def test_the_file_has_the_documented_layout(record, tmp_path):
    with h5netcdf.File(record.save(tmp_path / "run.nc")) as file:
        assert {name: d.size for name, d in file.dimensions.items()} == {
            "time": 200, "parameter": 12
        }  # fmt: skip
        assert set(file.variables) == {*ARRAYS, "parameter"}
        assert file["true_parameters"].dimensions == ("time", "parameter")
        assert file["torque"].dimensions == ("time",) and file["torque"].dtype == np.float64
        assert [file[n].attrs["units"] for n in ("time", "torque", "angle", "speed")] == [
            "s", "N m", "rad", "rad/s"
        ]  # fmt: skip
        assert json.loads(file.attrs["scenario"])["name"] == "x"
        assert {"hash", "seed", "burn_in", "versions"} <= set(file.attrs)
    with h5py.File(tmp_path / "run.nc") as file:
        assert h5py.check_string_dtype(file["parameter"].dtype).length is None  # variable length
        assert [name.decode() for name in file["parameter"][:]] == list(PARAMETER_NAMES)


def test_valid_is_kept(record, tmp_path):
    valid = np.ones(200, dtype=bool)
    valid[10:20] = False
    again = load_record(dataclasses.replace(record, valid=valid).save(tmp_path / "run.nc"))
    assert again.valid.dtype == bool and np.array_equal(again.valid, valid)


@pytest.mark.parametrize("output", ["speed", "increment", "angle"])
def test_an_own_log_needs_time_torque_and_one_output_only(output, own, tmp_path):
    own[output] = own.pop("speed")
    log = load_record(write(tmp_path / "own.nc", own))
    assert np.array_equal(getattr(log, output), own[output])
    assert log.true_parameters is None and log.true_speed is None and log.seed is None
    assert log.scenario == {} and log.burn_in == 0.0
    assert log.period == pytest.approx(0.01)
    again = load_record(log.save(tmp_path / "again.nc"))
    assert np.array_equal(again.torque, own["torque"]) and again.seed is None


def test_not_a_file(tmp_path):
    with pytest.raises(RecordError, match=r"gone.nc: no such file"):
        load_record(tmp_path / "gone.nc")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_told(record, share, tmp_path):
    path = record.save(tmp_path / "run.nc")
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(RecordError, match=r"run.nc: no NetCDF-4 file, or a broken one"):
        load_record(path)


@pytest.mark.parametrize("content", [b"time,torque,speed\n0,1,2\n", b"CDF\x01" + bytes(100)])
def test_a_foreign_file_is_told(content, tmp_path):
    path = tmp_path / "foreign.nc"
    path.write_bytes(content)
    with pytest.raises(RecordError, match=r"foreign.nc: no NetCDF-4 file"):
        load_record(path)


def test_a_foreign_netcdf_file_is_told(tmp_path):
    with h5netcdf.File(tmp_path / "sea.nc", "w") as file:
        file.dimensions = {"depth": 3}
        file.create_variable("salt", ("depth",), data=np.ones(3))
    with pytest.raises(RecordError, match=r"sea\.nc: variable 'time' is missing; there are salt"):
        load_record(tmp_path / "sea.nc")


@pytest.mark.parametrize("name", ["time", "torque", "speed"])
def test_a_missing_variable_is_named(name, own, tmp_path):
    del own[name]
    with pytest.raises(RecordError, match=f"own.nc: .*{name}.*there "):
        load_record(write(tmp_path / "own.nc", own))


def test_plain_hdf5_without_netcdf_dimensions_is_read(own, tmp_path):
    with h5py.File(tmp_path / "own.nc", "w") as file:
        for name, values in own.items():
            file[name] = values
    assert np.array_equal(load_record(tmp_path / "own.nc").speed, own["speed"])


@pytest.mark.parametrize("name", ["time", *ARRAYS[1:]])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_named_with_its_sample(name, value, record, tmp_path):
    path = record.save(tmp_path / "run.nc")
    with h5py.File(path, "r+") as file:
        index = (17, PARAMETER_NAMES.index("f_m")) if name == "true_parameters" else 17
        file[name][index] = value
    place = "sample 17, f_m" if name == "true_parameters" else "sample 17"
    with pytest.raises(RecordError, match=f"run.nc: {name} is {value} at {place}"):
        load_record(path)


def test_shapes_that_do_not_fit_are_told(own):
    with pytest.raises(RecordError, match=r"torque has shape \(99,\).*must be \(100,\)"):
        Record(**{**own, "torque": own["torque"][:-1]})
    with pytest.raises(RecordError, match=r"true_parameters has shape \(100, 11\)"):
        Record(**own, true_parameters=np.ones((100, 11)))
    with pytest.raises(RecordError, match=r"valid has shape \(3,\)"):
        Record(**own, valid=np.ones(3, dtype=bool))
    with pytest.raises(RecordError, match="at least 2 samples"):
        Record(time=np.zeros(1), torque=np.zeros(1), speed=np.zeros(1))
    with pytest.raises(RecordError, match="one of speed, increment, angle"):
        Record(time=own["time"], torque=own["torque"])


def test_time_must_advance_evenly(own):
    def moved(k, by):
        time = own["time"].copy()
        time[k:] += by
        return {**own, "time": time}

    with pytest.raises(RecordError, match="does not advance at sample 50"):
        Record(**moved(50, -0.02))
    with pytest.raises(RecordError, match=r"not even: 0\.05 s from sample 49 to 50, but 0\.01 s"):
        Record(**moved(50, 0.04))
    Record(**moved(50, 1e-5))  # jitter of a thousandth of a period is no gap


@pytest.mark.parametrize(
    ("attribute", "value"), [("scenario", "{"), ("seed", "one"), ("burn_in", "long")]
)
def test_a_broken_attribute_is_named(attribute, value, own, tmp_path):
    path = write(tmp_path / "own.nc", own, **{attribute: value})
    with pytest.raises(RecordError, match=f"attribute '{attribute}' cannot be read"):
        load_record(path)


def test_saving_where_one_cannot_is_told(record, tmp_path):
    with pytest.raises(RecordError, match="there is no folder"):
        record.save(tmp_path / "gone" / "run.nc")
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(RecordError, match="cannot be written"):
        record.save(tmp_path / "folder.nc")
    assert os.listdir(tmp_path) == ["folder.nc"]


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_told(record, tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(RecordError, match="cannot be written"):
        record.save(tmp_path / "run.nc")


@pytest.mark.parametrize("room", [1_000, 20_000])
def test_a_full_disk_is_said_and_ends_no_process(record, tmp_path, room):
    """A limit on the size of files fails the same writes as a disk without room."""
    import resource

    path = record.save(tmp_path / "run.nc")
    before, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    assert len(before) > room
    code = (
        "import sys; from flexaxis.sim.record import load_record; from resource import *\n"
        f"record = load_record({str(path)!r}); setrlimit(RLIMIT_FSIZE, ({room}, {limits[1]}))\n"
        "try: record.save(sys.argv[1])\n"
        "except ValueError as error: print(error)"
    )
    child = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert (child.returncode, child.stderr) == (0, "")
    assert child.stdout.endswith("run.nc: cannot be written: [Errno 27] File too large.\n")
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["run.nc"]


def test_a_saved_file_has_the_users_permissions(record, tmp_path):
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(record.save(tmp_path / "run.nc").stat().st_mode) == 0o666 & ~mask


@pytest.mark.parametrize(
    ("signals", "line"),
    [
        ({"speed": [0.0, float("nan"), 1.0]}, "speed is nan at sample 1 (1 such values); mark"),
        ({"torque": [0.0, float("inf"), 1.0]}, "torque is inf at sample 1"),
        ({"valid": [1, float("nan"), 0]}, "valid is nan at sample 1"),
        ({"speed": [0.0, None, 1.0]}, "speed is nan at sample 1"),
        ({"speed": ["slow", "fast", "1"]}, "speed is no array of numbers"),
        ({"true_parameters": [[1.0], [1.0, 2.0], [3.0]]}, "true_parameters is no array of numbers"),
    ],
)
def test_lists_are_checked_like_arrays(signals, line):
    good = {"time": [0.0, 0.005, 0.01], "torque": [0.0, 1.0, 2.0], "speed": [0.0, 1.0, 2.0]}
    with pytest.raises(RecordError) as caught:
        Record(**(good | signals))
    assert str(caught.value).startswith(line)


def test_lists_become_arrays():
    record = Record(time=[0, 1, 2], torque=[0, 1, 2], speed=[0.0, 1.0, 2.0], valid=[1, 0, 1])
    assert record.torque.dtype == float and record.period == 1.0
    assert record.valid.tolist() == [True, False, True] and record.valid.dtype == bool
