"""An unscented Kalman filter as a user-written estimator without imports from flexaxis.

    flexaxis check docs/examples/ukf.py:Ukf
    flexaxis run headline --estimator ekf --estimator docs/examples/ukf.py:Ukf

R. van der Merwe and E. A. Wan, *The square-root unscented Kalman filter for state and
parameter-estimation*, ICASSP 2001. Unlike the square-root filter in that paper, this filter
propagates the covariance matrix itself, and uses alpha = 1.
"""

import numpy as np

TERMS = 16  # terms of the exponential series; exact up to rounding with two substeps of 2.5 ms
SUBSTEPS = 2


class Ukf:
    """Estimate the axis state and the relative parameters (modelled as random walks) jointly."""

    names = ("k_T", "1/J_a", "f_m")  # entries of theta
    output = "speed"  # meaning of y
    knob = "walk"  # tuning parameter that trades noise for speed

    def __init__(self, nominal, period, *, walk=0.001162, spread=0.2):
        # walk: std of the change in a relative parameter over 1 s; spread: initial std of the
        # relative parameter
        self.nominal, self.period = dict(nominal), period
        self.start = np.array([nominal["k_T"], 1 / nominal["J_a"], nominal["f_m"]])
        self.xi = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # theta/start, x
        self.P = np.diag([spread**2] * 3 + [0.0] * 5)
        self.W = np.diag([walk**2 * period] * 3 + [0.0] * 5)
        self.samples, self.last, self.squares = 0, np.zeros(4), np.zeros(2)
        self.noise = 0.0

    @property
    def theta(self):
        """Return the parameter estimates (3,)."""
        return self.xi[:3] * self.start

    @property
    def covariance(self):
        """Return the covariance matrix (3, 3) of the parameter estimates."""
        return self.P[:3, :3] * np.outer(self.start, self.start)

    def step(self, u, y):
        """Process the torque u[k] and the speed y[k] (None in a gap), and return theta[k]."""
        if y is not None:
            self._measure(y)
        theta = self.theta
        self._move(u)  # u[k] acts from now on and first affects y[k+1]
        return theta

    def _measure(self, y):
        """Update the estimate xi and the covariance P with the measured speed y.

        The speed is a state variable, so the update needs no sigma points.
        """
        residual = y - self.xi[5]
        self._learn_noise(residual)
        if self.samples < 20:  # too few samples to estimate the noise
            return
        variance = self.P[5, 5] + self.noise
        gain = self.P[:, 5] / variance
        self.xi = self.xi + gain * residual
        self.xi[:3] = np.clip(self.xi[:3], 0.1, 10.0)
        self.P = self.P - variance * np.outer(gain, gain)

    def _learn_noise(self, residual):
        """Estimate the variance of the measurement noise with a time constant of 2 s.

        The slow part of the residual comes from wrong parameters, and third differences remove it.
        """
        self.last = np.append(self.last[1:], residual)
        self.samples += 1
        limit = 9 * (self.P[5, 5] + self.noise) if self.samples > 20 else np.inf  # against faults
        new = np.array([residual, (self.last @ [-1, 3, -3, 1]) / np.sqrt(20)]) ** 2
        self.squares += (np.minimum(new, limit) - self.squares) / min(
            self.samples, 2.0 / self.period
        )
        self.noise = max(min(self.squares), 1e-300)

    def _move(self, u):
        """Propagate sigma points through the sampled model, and update the mean and covariance."""
        sizes = np.sqrt(np.diag(self.P))
        units = np.where(sizes > 0, sizes, 1.0)  # scales P to a correlation matrix
        values, vectors = np.linalg.eigh(self.P / np.outer(units, units))
        root = (units[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T
        reach = np.sqrt(len(root)) * np.vstack([0 * root[:1], root, -root])
        points = self.xi + reach
        points[:, 3:] = self._sampled(np.clip(points[:, :3], 0.1, 10.0), points[:, 3:], u)
        self.xi = points[1:].mean(axis=0)
        apart = points - self.xi
        weights = np.r_[2.0, np.full(len(apart) - 1, 1 / (len(apart) - 1))]
        self.P = (weights * apart.T) @ apart + self.W
        shrink = np.ones(8)
        shrink[:3] = 1 / np.sqrt(np.maximum(1.0, np.diag(self.P)[:3]))  # std at most 100 %
        self.P *= np.outer(shrink, shrink)

    def _sampled(self, eta, x, u):
        """Return the states of the sigma points one sample later.

        The states x have the shape (points, 5), and the parameters eta have the shape (points, 3).
        The state x contains the motor-gear twist, the gear-arm twist, and the speeds of the motor,
        the gear and the arm.
        """
        q = self.nominal
        k_T, inverse_J_a, f_m = (eta * self.start).T
        r, k_g, k_a, d_g, d_a = (q[name] for name in ("r", "k_g", "k_a", "d_g", "d_a"))
        A, B = np.zeros((len(eta), 5, 5)), np.zeros((len(eta), 5))
        A[:, 0, 2], A[:, 0, 3], A[:, 1, 3], A[:, 1, 4] = r, -1, 1, -1
        gear, arm = np.array([k_g, 0, r * d_g, -d_g, 0]), np.array([0, k_a, 0, d_a, -d_a])
        A[:, 2], A[:, 3], A[:, 4] = -r * gear / q["J_m"], (gear - arm) / q["J_g"], arm
        A[:, 4] *= inverse_J_a[:, None]
        A[:, 2, 2] -= f_m / q["J_m"]
        A[:, 3, 3] -= q["f_g"] / q["J_g"]
        A[:, 4, 4] -= q["f_a"] * inverse_J_a
        B[:, 2] = k_T * u / q["J_m"]
        step = self.period / SUBSTEPS
        for _ in range(SUBSTEPS):
            term = step * ((A @ x[..., None])[..., 0] + B)
            x = x + term
            for k in range(2, TERMS):
                term = step / k * (A @ term[..., None])[..., 0]
                x = x + term
        return x
