"""
The paper, literally: a matrix exponential of the extended system in every sample.

Östring and Gunnarsson, *Recursive identification of physical parameters in a flexible robot arm*.
In θ and not in θ/θ(0), and without anything that is not in the paper.
"""

import numpy as np

from acceptance.axes import held


def measurement_update(P, psi):
    """P(t|t), eq. (7)."""
    return P - P @ np.outer(psi, psi) @ P / (1 + psi @ P @ psi)


def time_update(P, forgetting, drift):
    """P̄(t+1|t), eq. (9) or (10)."""
    return P / forgetting + drift


def regularize(P, regularization):
    """P(t+1|t) = P̄ (I + μ P̄)⁻¹, eq. (12)."""
    return P @ np.linalg.inv(np.eye(len(P)) + regularization * P)


def symmetric(P):
    """P without its antisymmetric part: rounding leaves some, and (9) lets it grow as λ⁻ᵏ."""
    return (P + P.T) / 2


class LiteralRpem:
    """Eq. (5)–(23) for a model as a function of θ, by its own matrices and their derivatives."""

    def __init__(self, model, theta0, P0, *, period, forgetting=1.0, drift=0.0, regularization=0.0):
        self.model, self.theta, self.period = model, np.array(theta0, float), period
        self.P = np.diag(P0)
        self.options = forgetting, np.diag(drift) if np.ndim(drift) == 1 else drift, regularization
        self.box = np.sort([0.1 * self.theta, 10 * self.theta], axis=0)
        self.X = np.zeros((len(self.theta) + 1, model.n))  # z_1 … z_p and x

    def run(self, u, y, valid=None):
        """θ (N, p)."""
        present = np.ones(len(u), bool) if valid is None else valid
        return np.array([self.sample(*each) for each in zip(u, y, present, strict=True)])

    def sample(self, u, y, valid):
        """θ after one sample."""
        forgetting, drift, regularization = self.options
        C, *dC = self.model.blocks(self.theta)[:, -1, :-1]
        self.psi = self.X[:-1] @ C + np.array(dC) @ self.X[-1]  # (16)
        if valid:
            epsilon = y - C @ self.X[-1]  # (6)
            self.P = symmetric(measurement_update(self.P, self.psi))
            self.theta = np.clip(self.theta + self.P @ self.psi * epsilon, *self.box)  # (5)
        self.P = symmetric(time_update(self.P, forgetting, drift))
        self.P = symmetric(regularize(self.P, regularization))
        F, G = self.extended()
        self.X[:, list(self.model.reset)] = 0.0
        self.X = (held(F, G, self.period) @ np.append(self.X, u)).reshape(self.X.shape)
        return self.theta

    def extended(self):
        """F and G of eq. (22)."""
        whole = self.model.blocks(self.theta)[:, :-1]
        (A, *dA), (B, *dB) = whole[..., :-1], whole[..., -1]
        F = np.kron(np.eye(len(dA) + 1), A)
        F[: -len(A), -len(A) :] = np.concatenate(dA)
        return F, np.concatenate([*dB, B])
