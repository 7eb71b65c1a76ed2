"""NetCDF files as others read them: by h5py, which knows nothing of how they were written."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest

from flexaxis.sim.storage.netcdf import add, declare, new_netcdf


def test_what_is_written_is_there_for_others(tmp_path):
    path, values = tmp_path / "some.nc", np.arange(6.0).reshape(3, 2)
    with new_netcdf(path) as file:
        add(file, "theta", ("time", "estimate"), values, units="rad", long_name="angles")
        add(file, "estimate", ("estimate",), ("k_T", "größer"))
        add(file, "valid", ("time",), np.array([True, False, True]))
        add(file, "still", ("time",), np.ones(3, np.float32), compress=True)
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["theta"][...], values)
        assert file["theta"].attrs["units"] == "rad"
        assert file["theta"].attrs["long_name"] == "angles"
        assert [scale.name for d in file["theta"].dims for scale in d.values()] == [
            "/time",
            "/estimate",
        ]
        assert h5py.check_string_dtype(file["estimate"].dtype).length is None  # any length
        assert [text.decode() for text in file["estimate"]] == ["k_T", "größer"]
        np.testing.assert_array_equal(file["valid"][...], np.array([1, 0, 1], np.int8))
        assert file["valid"].dtype == np.int8 and file["still"].dtype == np.float32
        assert file["still"].compression == "gzip" and file["theta"].compression is None
        assert not set(file["valid"].attrs) & {"units", "long_name"}


def test_a_variable_may_be_filled_in_pieces_and_in_a_group(tmp_path):
    path = tmp_path / "some.nc"
    with new_netcdf(path) as file:
        group = file.create_group("one")
        variable = declare(group, "x", {"time": 5}, float, units="s")
        for k in range(0, 5, 2):
            variable[k : k + 2] = np.arange(5.0)[k : k + 2]
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["one/x"][...], np.arange(5.0))


def test_a_file_that_was_not_finished_leaves_the_old_one(tmp_path):
    path = tmp_path / "some.nc"
    with new_netcdf(path) as file:
        add(file, "x", ("time",), [1.0])
    with pytest.raises(RuntimeError, match="half"), new_netcdf(path) as file:
        add(file, "x", ("time",), [2.0])
        raise RuntimeError("half way")
    assert [found.name for found in tmp_path.iterdir()] == ["some.nc"]
    with h5py.File(path) as file:
        assert list(file["x"]) == [1.0]


def test_a_length_that_does_not_fit_its_dimension_is_refused(tmp_path):
    with pytest.raises(ValueError), new_netcdf(tmp_path / "some.nc") as file:
        add(file, "x", ("time",), [1.0, 2.0])
        add(file, "y", ("time",), [1.0])


FULL = """
import resource, signal, sys
import numpy as np
from flexaxis.sim.storage.netcdf import add, declare, new_netcdf

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
try:
    with new_netcdf(sys.argv[1]) as file:
        x = declare(file, "x", {"time": 20_000}, float)
        add(file, "estimate", ("estimate",), ["k_T", "f_m"])
        for k in range(0, 20_000, 1000):
            x[k : k + 1000] = k
        add(file, "y", ("time",), np.random.default_rng(0).random(20_000), compress=True)
except OSError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on the size of a file there")
@pytest.mark.parametrize("limit", [0, 10_000, 165_000, 300_000])
def test_a_full_disk_is_an_error_and_leaves_the_old_file(limit, tmp_path):
    path = tmp_path / "some.nc"
    path.write_text("old")
    words = [sys.executable, "-c", FULL, path, str(limit)]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "") and "File too large" in done.stdout
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["some.nc"]
