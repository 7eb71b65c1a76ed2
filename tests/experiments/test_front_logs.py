"""Own logs in Python: what the commands say, as tables with figures."""

import numpy as np
import pytest
from identify_axes import VALUES, log

import flexaxis as fx


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A log of one mass without dry friction, as a table of text."""
    path, record = (
        tmp_path_factory.mktemp("front") / "log.csv",
        log(1, 0, "multisine", seed=0, seconds=8.0),
    )
    rows = np.column_stack([record.time, record.torque, np.degrees(record.angle)])
    head = "time [s],torque [Nm],angle [deg]"
    np.savetxt(path, rows, "%.12g", ",", header=head, comments="")
    return path


def test_a_log_is_imported_identified_and_tracked(table):
    read = fx.import_log(table, torque_is="held")
    assert set(read.to_dataframe()["verdict"]) <= {"ok", "note"}
    found = fx.identify(read, "one_mass", friction="none")
    values = found.to_dataframe().set_index("parameter")["value"]
    assert values["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.01)
    assert [*values.index[-2:]] == ["delay", "offset"]
    for result in (read, found):
        axes = np.atleast_1d(np.asarray(result.plot(), dtype=object))
        assert axes.ravel()[0].lines
    followed = fx.track(read, found, ["1/J_m"])
    assert followed[0]["ratio"] == pytest.approx(1, abs=0.02)
