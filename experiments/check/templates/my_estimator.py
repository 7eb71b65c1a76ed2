"""My estimator of the motor friction f_m, with NumPy and SciPy only.

It works as it is: a predictor of the axis with the present estimate, corrected by recursive least
squares on its error. Change what you like; the places to begin with are marked (1) to (3).

    flexaxis check my_estimator.py:Mine
    cp my_estimator.py old.py
    flexaxis compare --base old.py:Mine --candidate my_estimator.py:Mine fm_step-v1
"""

import numpy as np
from scipy.linalg import expm


class Mine:
    """Recursive prediction-error method for one parameter, with a forgetting factor."""

    names = ("f_m",)  # (1) what theta means; "k_T", "1/J_a", ... are others
    knob = "1-forgetting"  # what buys speed with noise: `tune`, `--match-std` turn λ in 1 − λ

    def __init__(self, nominal, period, *, output="speed", forgetting=0.995):
        # nominal: the 12 physical parameters by name (SI); period in s; output: what y is.
        # Other keywords are options: my_estimator.py:Mine[forgetting=0.99]
        self.nominal, self.period, self.output = dict(nominal), period, output
        self.forgetting = forgetting
        self.theta = nominal["f_m"]
        self.bounds = (np.array([0.1 * self.theta]), np.array([10 * self.theta]))
        self.P = 1e-3 * (1 - forgetting)  # variance of theta over that of the noise
        self.X = np.zeros(12)  # sensitivity dx/dtheta, then the state x
        self.u = 0.0

    def step(self, u, y):
        """Take torque u[k] and output y[k] (None in a gap); return theta[k]."""
        before = self.X
        # y[k] was measured before u[k] acts: the input since the last sample is the old one.
        self.X = self._held_input() @ np.append(self.X, self.u)
        self.u = u
        if y is not None:
            psi, predicted = self._output(before)
            self._update(psi, y - predicted)
        return np.array([self.theta])

    def _update(self, psi, error):
        """(2) How an error of the prediction changes the estimate."""
        gain = self.P * psi / (1 + psi * self.P * psi)
        self.P = (1 - gain * psi) * self.P / self.forgetting
        self.theta = float(np.clip(self.theta + gain * error, *np.concatenate(self.bounds)))

    def _output(self, before):
        """Return the sensitivity of y and its prediction: motor speed, or increment of angle."""
        if self.output == "speed":
            return self.X[2], self.X[8]
        return (self.X[5] - before[5]) / self.period, (self.X[11] - before[11]) / self.period

    def _held_input(self):
        """Return the matrix that takes sensitivity, state and input over one period."""
        A, B = self._model(self.theta)
        dA = np.zeros((6, 6))  # derivative of A with respect to theta; that of B is zero
        dA[2, 2] = -1 / self.nominal["J_m"]
        M = np.zeros((13, 13))
        M[:6, :6], M[:6, 6:12], M[6:12, 6:12], M[6:12, 12] = A, dA, A, B
        return expm(M * self.period)[:12]

    def _model(self, f_m):
        """(3) x = two twists, speeds of motor, gear and arm, angle of the motor."""
        n = self.nominal
        r, J_m, J_g, J_a, d_g, d_a = (n[k] for k in ("r", "J_m", "J_g", "J_a", "d_g", "d_a"))
        A = np.zeros((6, 6))
        A[0, 2:4] = r, -1
        A[1, 3:5] = 1, -1
        A[2, :5] = np.array([-r * n["k_g"], 0, -(r**2 * d_g + f_m), r * d_g, 0]) / J_m
        A[3, :5] = np.array([n["k_g"], -n["k_a"], r * d_g, -(n["f_g"] + d_g + d_a), d_a]) / J_g
        A[4, :5] = np.array([0, n["k_a"], 0, d_a, -(d_a + n["f_a"])]) / J_a
        A[5, 2] = 1
        return A, np.array([0, 0, n["k_T"] / J_m, 0, 0, 0])
