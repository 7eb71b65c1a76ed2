"""An estimator of the motor friction f_m, which uses only NumPy and SciPy.

The template works without changes. The estimator predicts the output with the current estimate, and
corrects the estimate with recursive least squares. The comments (1) to (3) mark good places for
your first changes.

    flexaxis check my_estimator.py:Mine
    cp my_estimator.py old.py
    flexaxis compare --base old.py:Mine --candidate my_estimator.py:Mine fm_step-v1
"""

import numpy as np
from scipy.linalg import expm


class Mine:
    """Recursive prediction-error method for one parameter, with a forgetting factor."""

    names = ("f_m",)  # (1) the parameters in theta; other parameters are "k_T", "1/J_a", ...
    output = "speed"  # the signal y; "increment" and "angle" are signals of an encoder
    knob = "1-forgetting"  # the quantity that `tune` and `--match-std` adjust: 1 − λ

    def __init__(self, nominal, period, *, forgetting=0.995):
        # nominal maps the names of the 12 physical parameters to values (SI); period is in s.
        # Other keyword arguments are options, as in my_estimator.py:Mine[forgetting=0.99].
        self.nominal, self.period, self.forgetting = nominal, period, forgetting
        self.theta = nominal["f_m"]
        self.P = 1e-3 * (1 - forgetting)  # variance of theta divided by the variance of the noise
        self.X = np.zeros(11)  # sensitivity dx/dtheta, the state x, and the last input

    def step(self, u, y):
        """Return theta[k] from the torque u[k] and the output y[k]; a missing output is None."""
        # y[k] was measured before u[k] acts, so the prediction of y[k] uses the previous input.
        self.X = expm(self._model() * self.period) @ self.X
        self.X[10] = u
        if y is not None:
            self._update(psi=self.X[2], error=y - self.X[7])
        return np.array([self.theta])

    def _update(self, psi, error):
        """(2) Use the prediction error to correct the estimate."""
        gain = self.P * psi / (1 + psi * self.P * psi)
        self.P = (1 - gain * psi) * self.P / self.forgetting
        ratio = (self.theta + gain * error) / self.nominal["f_m"]
        self.theta = self.nominal["f_m"] * np.clip(ratio, 0.1, 10)

    def _model(self):
        """(3) Return the matrix M of dX/dt = M X; x has two shaft twists and three speeds."""
        names = "r k_T J_m J_g J_a k_g k_a d_g d_a f_g f_a"
        r, k_T, J_m, J_g, J_a, k_g, k_a, d_g, d_a, f_g, f_a = map(
            self.nominal.__getitem__, names.split()
        )
        M = np.zeros((11, 11))
        M[5:10, 5:10] = M[:5, :5] = [
            [0, 0, r, -1, 0],
            [0, 0, 0, 1, -1],
            [-r * k_g / J_m, 0, -(r**2 * d_g + self.theta) / J_m, r * d_g / J_m, 0],
            [k_g / J_g, -k_a / J_g, r * d_g / J_g, -(f_g + d_g + d_a) / J_g, d_a / J_g],
            [0, k_a / J_a, 0, d_a / J_a, -(d_a + f_a) / J_a],
        ]
        M[2, 7] = -1 / J_m  # derivative of A with respect to theta
        M[7, 10] = k_T / J_m
        return M
