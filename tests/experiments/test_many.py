"""Many logs of one axis: a row of estimates each, a covariate, and one change."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import flexaxis as fx
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.identify import find_logs

T, N, J = 0.005, 1200, 0.01
AXIS = f"""model = "one_mass"
noise = 0.02
rate = {1 / T}
[nominal]
k_T = 1.0
J_m = {J}
f_m = 0.05
[deviation]
J_m = 1e-5
f_m = 1e-4
"""


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    """Thirty logs: friction falls by 1 % a kelvin, and grows by 12 % on day 18."""
    folder = tmp_path_factory.mktemp("days")
    (folder / "axis.toml").write_text(AXIS)
    rng = np.random.default_rng(0)
    for day in range(30):
        kelvin = rng.normal(0, 4)
        f = 0.05 * (1 - 0.01 * kelvin) * (1.12 if day >= 18 else 1.0)
        u = rng.standard_normal(N)
        keep = np.exp(-f / J * T)
        speed = lfilter([0, (1 - keep) / f], [1, -keep], u) + 0.02 * rng.standard_normal(N)
        columns = {"time [s]": T * np.arange(N), "torque [Nm]": u, "speed [rad/s]": speed}
        table = pd.DataFrame(columns | {"temp": 25 + kelvin})
        table.to_csv(folder / f"log_{day + 1}.csv", index=False, float_format="%.9g")
    return folder


@pytest.mark.slow
def test_a_change_and_a_covariate_are_found(days, capsys):
    names = [path.name for path in find_logs(days)]
    assert names == [f"log_{day}.csv" for day in range(1, 31)]
    words = ["identify", days, "--model", days / "axis.toml", "--covariate", "temp"]
    assert main([*map(str, words), "-o", str(days.with_suffix(".csv"))]) == 1
    said = capsys.readouterr().out
    assert 11 < float(re.search(r"f_m changed by \+([\d.]+)", said)[1]) < 13
    assert "at log_19.csv" in said
    assert "per unit of temp" in said and "J_m = 0.01, no change" in said
    table = pd.read_csv(days.with_suffix(".csv"), index_col=0)
    assert [*table.columns] == ["J_m", "f_m", "J_m_sd", "f_m_sd", "temp"] and len(table) == 30
    assert "<svg" in days.with_suffix(".html").read_text()


def test_a_log_that_cannot_be_read_is_left_out_and_named(days, tmp_path):
    for name in ("log_1.csv", "log_2.csv"):
        (tmp_path / name).write_bytes((days / name).read_bytes())
    (tmp_path / "log_3.csv").write_text("time,torque,speed\n")
    result = fx.identify(tmp_path, days / "axis.toml", free=["J_m"])
    assert result.status == 1 and len(result.table) == 2
    assert "log_3.csv is left out" in repr(result)
    assert result.result.findings[0].kind == "info"  # too few logs; the status stays as it is
    assert result.table["J_m"].to_numpy() == pytest.approx(J, rel=0.01)
