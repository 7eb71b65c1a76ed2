"""The closed loop of an axis at any sampling period: exact zero-order hold, without MuJoCo."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from flexaxis.sim.parameters import preset

AXES = {name: preset(name).as_dict() for name in ("n1", "n2")}
NAMES = ("k_T", "1/J_a", "f_m")
SIGMA = 0.1  # rad/s


@dataclass(frozen=True)
class Run:
    """
    What an estimator is given, and the truth.

    Attributes
    ----------
    u, y, clean : (N,) arrays
        Torque held from t_k on, speed as measured at t_k, and without noise.
    theta : (N, 3) array
        The true values of `NAMES`.
    period : float
        Sampling period [s].
    angle : (N,) array
        Of the motor; empty where the run was put together of parts.
    """

    u: np.ndarray
    y: np.ndarray
    clean: np.ndarray
    theta: np.ndarray
    period: float
    angle: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def increment(self) -> np.ndarray:
        return np.diff(self.angle, prepend=self.angle[0]) / self.period

    def samples(self, seconds: float) -> int:
        return round(seconds / self.period)


def system(q: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """A (6, 6) and B (6,) of (3), (4), written out by hand, and the motor angle as sixth state."""
    A, B = np.zeros((6, 6)), np.zeros(6)
    A[0, 2:4] = q["r"], -1
    A[1, 3:5] = 1, -1
    A[2, [0, 2, 3]] = -q["r"] * q["k_g"], -(q["r"] ** 2) * q["d_g"] - q["f_m"], q["r"] * q["d_g"]
    A[2] /= q["J_m"]
    A[3, :5] = q["k_g"], -q["k_a"], q["r"] * q["d_g"], -q["f_g"] - q["d_g"] - q["d_a"], q["d_a"]
    A[3] /= q["J_g"]
    A[4, [1, 3, 4]] = q["k_a"], q["d_a"], -q["d_a"] - q["f_a"]
    A[4] /= q["J_a"]
    A[5, 2] = 1
    B[2] = q["k_T"] / q["J_m"]
    return A, B


def held(A: np.ndarray, B: np.ndarray, period: float) -> np.ndarray:
    """[Φ, Γ] (n, n+1) of a period in which the input (n,) is held."""
    return expm(np.pad(np.column_stack([A, B]), ((0, 1), (0, 0))) * period)[:-1]


def theta_of(q: Mapping[str, float], names: Sequence[str] = NAMES) -> np.ndarray:
    return np.array([1 / q[n[2:]] if n.startswith("1/") else q[n] for n in names])


def scaled(q: Mapping[str, float], factor: float, names: Sequence[str] = NAMES) -> dict[str, float]:
    """The parameters with every θ ``factor`` times as large."""
    changes = {
        n.removeprefix("1/"): q[n.removeprefix("1/")] * factor ** (-1 if "/" in n else 1)
        for n in names
    }
    return dict(q) | changes


def reference(seed: int, seconds: float, period: float) -> np.ndarray:
    """Equal lines from 0.1 to 30 Hz, random phases, period 10 s, rms 0.0511 rad; one at any T."""
    rng = np.random.default_rng(seed)
    phases = np.exp(2j * np.pi * rng.random(300))
    lines = np.zeros(round(10.0 / period) // 2 + 1, complex)
    lines[1:301] = phases
    once = np.fft.irfft(lines)
    return np.resize(0.0511 * once / once.std(), round(seconds / period))


def loop_matrix(
    q: Mapping[str, float], period: float, speed_gain: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return M (9, 9), N (9,) and the row (10,) of u: z⁺ = M z + N ρ, u = row·[z, ρ].

    z = [x (6), low-passed speed error, integral, last error], ρ the reference.
    """
    smooth = np.exp(-period / 0.0005)
    error = np.zeros(10)
    error[5], error[9] = -1.0, 1.0
    last, lowpass, integral = np.eye(10)[8], np.eye(10)[6], np.eye(10)[7]
    lowpass = smooth * lowpass + (1 - smooth) / period * (error - last)
    wanted = 4.0 * error + lowpass
    integral = integral + 2.0 * period * wanted
    u = speed_gain * (wanted + integral)
    A, B = system(q)
    step = held(A, B, period)
    plant = np.pad(step[:, :6], ((0, 0), (0, 4))) + np.outer(step[:, 6], u)
    whole = np.vstack([plant, lowpass, integral, error])
    return whole[:, :9], whole[:, 9], u


def speed_gain(period: float) -> float:
    """The shipped gain [N m s/rad], less where a slow loop would not be stable with it."""
    return 0.22 * min(1.0, 0.005 / period)


def simulate(
    axis: Mapping[str, float],
    seconds: float,
    *,
    period: float = 0.005,
    seed: int = 0,
    sigma: float = SIGMA,
    faults: Mapping[float, Mapping[str, float]] | None = None,
    pause: tuple[float, float] = (0.0, 0.0),
    off: tuple[float, float] = (0.0, 0.0),
) -> Run:
    """
    Run the loop from rest.

    Parameters
    ----------
    faults : mapping
        Time [s] -> all parameters from then on.
    pause, off : (start, stop)
        When the reference is held, and when the drive is off: no torque, and after a second the
        axis has stopped and the sensor reads zero. The loop comes back as at the start.
    """
    N = round(seconds / period)
    rho = reference(seed, seconds, period)
    a, b = (round(t / period) for t in pause)
    rho[a:b] = rho[a]
    off_from, off_to = (round(t / period) for t in off)
    changes = {round(t / period): q for t, q in (faults or {}).items()} | {0: axis}
    u, clean, angle, theta = np.zeros(N), np.zeros(N), np.zeros(N), np.empty((N, 3))
    z, shift = np.zeros(9), 0.0
    for k in range(N):
        if k in changes:
            M, n, row = loop_matrix(changes[k], period, speed_gain(period))
            free = loop_matrix(changes[k], period, 0.0)[0]
        theta[k] = theta_of(changes[k]) if k in changes else theta[k - 1]
        clean[k], angle[k] = z[2], z[5]
        if off_from <= k < off_to:
            z = free @ z
            z[6:] = 0.0
            if (k - off_from) * period >= 1.0:
                z[:5] = 0.0
            shift = z[5] - rho[min(k + 1, N - 1)]
            continue
        u[k] = row[:9] @ z + row[9] * (rho[k] + shift)
        z = M @ z + n * (rho[k] + shift)
    y = clean + sigma * np.random.default_rng([seed, 1]).standard_normal(N)
    y[off_from + round(1.0 / period) : off_to] = 0.0
    return Run(u, y, clean, theta, period, angle)
