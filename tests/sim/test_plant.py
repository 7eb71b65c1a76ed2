"""The MuJoCo plant against equations (3) and (4), and against itself in batches."""

import numpy as np
import pytest

from flexaxis.sim.errors import SimulationError
from flexaxis.sim.parameters import PARAMETER_NAMES, AxisParameters, preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.timing import PERIOD

from .conftest import state_space
from .motion import linearised

N1 = preset("n1")


def plant_of(parameters):
    return Plant(parameters, period=PERIOD, substeps=5)


def random_parameters(count):
    rng = np.random.default_rng(1)
    values = np.array([*N1.values()]) * np.exp(rng.normal(0, 0.5, (count, len(PARAMETER_NAMES))))
    values[:, -1] = rng.uniform(0.005, 0.02, count)
    return values


@pytest.mark.parametrize(
    "theta", [np.array([*N1.values()]), np.array([*preset("n2").values()]), *random_parameters(5)]
)
def test_linearisation_is_equations_3_and_4(theta):
    parameters = AxisParameters(**dict(zip(PARAMETER_NAMES, theta.tolist(), strict=True)))
    A, B = linearised(parameters)
    A0, B0 = state_space(theta)
    # Row by row, for the entries of different rows differ by 1e8. Rounding alone gives 1e-15.
    scale = np.abs(A0).max(axis=1, keepdims=True)
    assert np.max(np.abs(A - A0) / scale) < 1e-12
    assert np.max(np.abs(B - B0)) < 1e-12 * np.abs(B0).max()


@pytest.fixture
def clean_folder(tmp_path, monkeypatch, capfd):
    """Run in an empty folder, which must stay empty, and print nothing."""
    monkeypatch.chdir(tmp_path)
    yield
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("clean_folder")
@pytest.mark.parametrize(
    ("torque", "parameters", "run"),
    [
        ([0.0, np.nan, 0.0], [N1] * 3, 1),
        ([0.0, 0.1], [N1, N1.replace(k_g=1e9)], 1),  # too stiff for a step of 1 ms
        ([1e12], [N1], 0),
    ],
)
def test_divergence_is_an_error_and_leaves_no_litter(torque, parameters, run):
    plant = plant_of(parameters)
    plant.step(np.zeros(len(parameters)))
    with pytest.raises(SimulationError, match=f"run {run} failed at t = 0.01") as caught:
        for _ in range(3):
            plant.step(np.array(torque))
    assert caught.value.run == run and "MuJoCo warning" in caught.value.reason
