"""Records on disk: what goes in comes out, and whatever is wrong is told."""

import dataclasses
import json

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


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_told(record, share, tmp_path):
    path = record.save(tmp_path / "run.nc")
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(RecordError, match=r"run.nc: the file is damaged or not NetCDF-4"):
        load_record(path)


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


def test_time_must_advance_evenly(own):
    def moved(k, by):
        time = own["time"].copy()
        time[k:] += by
        return {**own, "time": time}

    with pytest.raises(RecordError, match="does not increase at sample 50"):
        Record(**moved(50, -0.02))
    with pytest.raises(RecordError, match=r"s 49 and 50 are 0\.05 s apart, but most samples are 0"):
        Record(**moved(50, 0.04))
    Record(**moved(50, 1e-5))  # jitter of a thousandth of a period is no gap
