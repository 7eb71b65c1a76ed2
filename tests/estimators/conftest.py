"""The closed loop of the axis without MuJoCo: exact zero-order hold of the linear model."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # `acceptance` is what several tests share

from acceptance.axes import AXES, Run, system
from acceptance.axes import simulate as exact

NOMINAL = AXES["n1"]


def simulate(
    seconds: float,
    *,
    seed: int = 0,
    parameters: Mapping[str, float] = NOMINAL,
    sigma: float = 0.1,
    **events: object,
) -> Run:
    """Run the loop; phases of the reference and the noise are drawn from one stream."""
    run = exact(parameters, seconds, seed=seed, **events)
    rng = np.random.default_rng(seed)
    rng.random(300)  # phases
    return replace(run, y=run.clean + sigma * rng.standard_normal(len(run.u)))


@pytest.fixture(scope="session")
def loop() -> Run:
    """60 s of the nominal axis."""
    return simulate(60.0)


@pytest.fixture(scope="session")
def nominal() -> Mapping[str, float]:
    """The axis that all tests are about."""
    return NOMINAL


@pytest.fixture(scope="session")
def simulated() -> Callable[..., Run]:
    """The simulation itself."""
    return simulate


@pytest.fixture(scope="session")
def by_hand() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """A and B, written out by hand, and the motor angle as sixth state."""
    return system
