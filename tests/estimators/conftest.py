"""The closed loop of the axis without MuJoCo: exact zero-order hold of the linear model."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).parent))  # `acceptance` is what several tests share

T = 0.005
NOMINAL = {
    "k_T": 1.0,
    "J_m": 1.2e-3,
    "J_g": 7.0,
    "J_a": 0.8,
    "k_g": 1.06e5,
    "k_a": 8.4e3,
    "d_g": 26.0,
    "d_a": 1.6,
    "f_m": 0.05,
    "f_g": 0.5,
    "f_a": 0.1,
    "r": 1 / 118,
}


@dataclass(frozen=True)
class Loop:
    """Torque, motor angle, and motor speed without and with noise, of one run; (N,) each."""

    u: np.ndarray
    angle: np.ndarray
    clean: np.ndarray
    y: np.ndarray

    @property
    def increment(self) -> np.ndarray:
        return np.diff(self.angle, prepend=self.angle[0]) / T


def axis(q: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """A (6, 6) and B (6,) of (3), (4), written out by hand, and the motor angle as sixth state."""
    A, B = np.zeros((6, 6)), np.zeros(6)
    A[0, 2:4] = q["r"], -1
    A[1, 3:5] = 1, -1
    A[2, [0, 2, 3]] = np.array(
        [-q["r"] * q["k_g"], -(q["r"] ** 2) * q["d_g"] - q["f_m"], q["r"] * q["d_g"]]
    )
    A[2] /= q["J_m"]
    A[3, :5] = q["k_g"], -q["k_a"], q["r"] * q["d_g"], -q["f_g"] - q["d_g"] - q["d_a"], q["d_a"]
    A[3] /= q["J_g"]
    A[4, [1, 3, 4]] = q["k_a"], q["d_a"], -q["d_a"] - q["f_a"]
    A[4] /= q["J_a"]
    A[5, 2] = 1
    B[2] = q["k_T"] / q["J_m"]
    return A, B


def multisine(rng: np.random.Generator, N: int) -> np.ndarray:
    """Equal lines from 0.1 to 30 Hz with random phase, period 10 s, rms 0.0511 rad."""
    lines = np.zeros(1001, complex)
    lines[1:301] = np.exp(2j * np.pi * rng.random(300))
    period = np.fft.irfft(lines)
    return np.resize(0.0511 * period / period.std(), N)


def simulate(
    seconds: float,
    *,
    seed: int = 0,
    parameters: Mapping[str, float] = NOMINAL,
    sigma: float = 0.1,
    pause: tuple[float, float] = (0.0, 0.0),
    faults: Mapping[float, Mapping[str, float]] | None = None,
) -> Loop:
    """Run the loop; the reference is held during the pause; ``faults``: time -> parameters."""
    rng = np.random.default_rng(seed)
    N = round(seconds / T)
    reference = multisine(rng, N)
    start, stop = (round(t / T) for t in pause)
    reference[start:stop] = reference[start]
    changes = {round(t / T): q for t, q in (faults or {}).items()} | {0: parameters}
    u, angle, speed = np.zeros((3, N))
    x, lowpass, integral, last = np.zeros(6), 0.0, 0.0, 0.0
    smooth = np.exp(-T / 0.0005)
    for k in range(N):
        if k in changes:
            A, B = axis(changes[k])
            step = expm(np.block([[A, B[:, None]], [np.zeros((1, 7))]]) * T)
        angle[k], speed[k] = x[5], x[2]
        error = reference[k] - x[5]
        lowpass = smooth * lowpass + (1 - smooth) * (error - last) / T
        last = error
        s = 4.0 * error + lowpass
        integral += T * 2.0 * s
        u[k] = 0.22 * (s + integral)
        x = step[:6, :6] @ x + step[:6, 6] * u[k]
    return Loop(u, angle, speed, speed + sigma * rng.standard_normal(N))


@pytest.fixture(scope="session")
def loop() -> Loop:
    """60 s of the nominal axis."""
    return simulate(60.0)


@pytest.fixture(scope="session")
def nominal() -> Mapping[str, float]:
    """The axis that all tests are about."""
    return NOMINAL


@pytest.fixture(scope="session")
def simulated() -> Callable[..., Loop]:
    """The simulation itself."""
    return simulate


@pytest.fixture(scope="session")
def by_hand() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """A and B, written out by hand."""
    return axis
