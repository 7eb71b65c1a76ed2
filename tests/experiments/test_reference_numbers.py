"""The numbers that everything is compared with, on reporting seeds.

Lag 1.25 / 1.35 / 0.94 s and rms before the fault .121 / .048 / .307 % were found on a linear model
with other random numbers, so agreement within 15 and 20 % also checks the plant.
"""

import numpy as np
import pytest

from flexaxis.experiments.catalogue import find_scenario
from flexaxis.experiments.harness import run

SEEDS = range(1000, 1060)
RMS = (0.121, 0.048, 0.307)  # % of nominal: k_T, 1/J_a, f_m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "column", "lag"),
    [("fm_step-v1", 2, 1.25), ("ja_step-v1", 1, 1.35), ("kt_step-v1", 0, 0.94)],
)
def test_forgetting_of_0995(name, column, lag):
    scenario = find_scenario(name)
    done = run([scenario], ["rpem-forgetting[forgetting=0.995]"], SEEDS)
    cases = [case for task in done for case in task.cases]
    lags = [case.rows[column]["lag"] for case in cases]
    rms = [np.sqrt(np.mean([case.rows[i]["std"] ** 2 for case in cases])) for i in range(3)]
    print(f"{name}: lag {np.mean(lags):.3f} s, rms before {np.round(rms, 4)} %")
    assert np.mean(lags) == pytest.approx(lag, rel=0.15)
    assert rms == pytest.approx(RMS, rel=0.20)
    assert not any(case.rows[0]["diverged"] for case in cases)
