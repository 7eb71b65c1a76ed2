"""The numbers that everything is compared with, on reporting seeds.

Lag 1.25 / 1.35 / 0.94 s and std before the fault .121 / .048 / .307 % were found on a linear model
with other random numbers, so agreement within 15 and 20 % also checks the plant.
"""

import numpy as np
import pytest
from engine_cases import BenchHere

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.summary import pool_rows

SEEDS = range(1000, 1060)
STD = (0.121, 0.048, 0.307)  # % of nominal: k_T, 1/J_a, f_m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "column", "lag"),
    [("fm_step-v1", 2, 1.25), ("ja_step-v1", 1, 1.35), ("kt_step-v1", 0, 0.94)],
)
def test_forgetting_of_0995(name, column, lag):
    scenario = find_scenario(name)
    text = "rpem-forgetting[forgetting=0.995]"
    (runs,) = BenchHere().runs([scenario], [text], SEEDS).values()
    lags = [run[column]["lag"] for run in runs]
    pooled = pool_rows([row for run in runs for row in run], scenario)
    std = [row["std"] for row in pooled]
    print(f"{name}: lag {np.mean(lags):.3f} s, std before {np.round(std, 4)} %")
    assert np.mean(lags) == pytest.approx(lag, rel=0.15)
    assert std == pytest.approx(STD, rel=0.20)
    assert not any(run[0]["diverged"] for run in runs)
