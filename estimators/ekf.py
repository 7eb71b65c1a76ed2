"""Joint extended Kalman filter for state and parameters, on the lanes of the compiled kernel."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.compiler import compile_loop, jit
from flexaxis.estimators.design import make_design
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.lanes import advance, evaluate
from flexaxis.estimators.model import Model
from flexaxis.estimators.pattern import Pattern, split
from flexaxis.estimators.plan import MAX_ORDER, plan
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]


class JointEkf:
    """
    Extended Kalman filter for ξ = [θ; x], with θ a random walk and no noise on x.

    θ[k+1] = θ[k] + w, cov w = W; x[k+1] = f(x[k], θ[k], u[k]), exact for a held u; y = h(x) + e,
    var e = σ². The textbook filter of L. Ljung, *Asymptotic behavior of the extended Kalman filter
    as a parameter estimator for linear systems*, IEEE Trans. AC 24 (1979). Unlike the
    prediction-error method it corrects the state as well, and knows σ.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    identify : sequence of str
        Parameters to estimate, or their inverses.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        Covariance of θ(0); x(0) = 0 is certain.
    drift : (p,) or (p, p) array_like
        W, what the covariance of θ gains in every sample.
    noise : float
        σ, standard deviation of the measured output [rad/s].
    period : float
        Sampling period T [s].
    bounds : (lower, upper), optional
        Box on which θ is projected after every update; 0.1 to 10 times θ(0) by default.
    output : {"speed", "increment"}
        What y is.

    Attributes
    ----------
    names, output, bounds
        As given.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        Its claimed covariance.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        drift: ArrayLike,
        noise: float = 0.1,
        period: float = 0.005,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
    ) -> None:
        if not (np.isfinite(noise) and noise > 0):
            raise EstimatorError(f"noise is {noise}; give the standard deviation of y, above 0")
        design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=None,
            drift=drift,
            regularization=0.0,
            bounds=bounds,
            output=output,
        )
        self.names, self.output = design.model.names, output
        self.bounds = design.lower, design.upper
        narrow, coefficients = split(design.model)
        pattern = _with_state(narrow)
        order, substeps = plan(design.model, design.lower, design.upper, period)
        row, column, _ = np.array(pattern.entries).T
        scale = np.where(row < pattern.n, period / substeps, 1.0)

        tuning = np.zeros(1, _tuning_type(pattern))
        tuning["coefficients"] = coefficients * scale[[entry for entry, *_ in pattern.terms]]
        tuning["weights"] = 1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1))
        tuning["order"], tuning["substeps"] = order, substeps
        tuning["drift"], tuning["variance"] = design.drift, noise**2
        tuning["lower"], tuning["upper"] = design.lower, design.upper

        p = narrow.p
        start = np.zeros(1, _state_type(pattern))
        start["theta"] = 1.0  # what pads θ must have an inverse
        start["theta"][0, :p] = design.theta0
        start["P"][0, :p, :p] = design.P0
        start["M"][0, :, : 1 + p] = (design.model.blocks(design.theta0)[:, row, column] * scale).T
        start["X"][0, : pattern.n, 1 + p : 1 + pattern.p] = np.eye(pattern.n)
        self._tuning, self._start = tuning, start
        self._loop = ekf_loop(pattern)
        self._p = p
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._state = self._start.copy()

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._state["theta"][0, : self._p].copy()

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._state["P"][0, : self._p, : self._p].copy()

    def step(self, u: float, y: float | None) -> Array:
        """
        Take one sample and return θ[k] (p,); y is None in a gap.

        Parameters
        ----------
        u : float
            Torque held from t_k on.
        y : float or None
            Output measured at t_k.
        """
        check_sample(u, y)
        return self.run([u], [0.0 if y is None else y], [y is not None])[0]

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Take N samples, from the current state on, and return θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
        valid : (N,) array_like of bool, optional
            False where y is missing.
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), self._p))
        self._loop(self._tuning, self._state, u, y, present, estimates)
        return estimates


def _with_state(pattern: Pattern) -> Pattern:
    """
    Return the pattern with n more parameters on which no entry depends.

    Their lanes, set to one at x(0), become the derivatives by the state at the start of the
    sample: the transition matrix comes out of the same rows as ∂x/∂θ.
    """
    n = pattern.n
    return pattern._replace(
        p=pattern.p + n, terms=tuple((*term, *[0] * n) for term in pattern.terms)
    )


def _tuning_type(pattern: Pattern) -> np.dtype:
    p = pattern.p - pattern.n
    return np.dtype(
        [
            ("coefficients", float, (len(pattern.terms),)),
            ("weights", float, (MAX_ORDER,)),  # 1/1!, 1/2!, …
            ("order", int),
            ("substeps", int),
            (
                "n",
                int,
            ),  # known only when it runs: the compiler would unroll every loop, for minutes
            ("p", int),
            ("drift", float, (p, p)),
            ("variance", float),
            ("lower", float, (p,)),
            ("upper", float, (p,)),
        ],
        align=True,
    )


def _state_type(pattern: Pattern) -> np.dtype:
    m, n, lanes = pattern.p, pattern.n, pattern.lanes
    return np.dtype(
        [
            ("theta", float, (m,)),
            ("P", float, (m, m)),  # of ξ = [θ; x]
            ("M", float, (len(pattern.entries), lanes)),
            (
                "X",
                float,
                (n + 1, lanes),
            ),  # x and y, with their derivatives by ξ of the sample before
            ("GP", float, (n, m)),
            ("Ph", float, (m,)),
            ("gain", float, (m,)),
        ],
        align=True,
    )


@lru_cache
def ekf_loop(pattern: Pattern) -> Callable:
    """
    Return the compiled loop for models of this pattern.

    Returns
    -------
    callable
        ``run(tuning, state, u, y, valid, estimates)``, as `flexaxis.estimators.kernel.rpem_loop`.
    """
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        n, p = len(state["GP"]), estimates.shape[1]
        for k in range(len(u)):
            correct(tuning, state, y[k], valid[k])
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            start_sample(state["X"], n, p)
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(p):
                estimates[k, i] = state["theta"][i]

    return compile_loop(run, flat, _tuning_type(pattern), _state_type(pattern))


@jit
def start_sample(X, n, p):
    """Set the derivatives by ξ at the start of a sample: ∂x/∂θ = 0, ∂x/∂x = I."""
    for i in range(n):
        for j in range(1, 1 + p + n):
            X[i, j] = 1.0 if j == 1 + p + i else 0.0


@jit
def correct(tuning, state, y, valid):
    """
    Take P over the last sample, and ξ and P through the measurement, in one step.

    With F = [I 0; G], G = ∂x⁺/∂ξ, and h = ∂y⁺/∂ξ, both by ξ of the sample before:
    S = hᵀPh + σ², K = F P h/S, ξ ← ξ⁺ + K (y − y⁺), P ← F P Fᵀ + W − K S Kᵀ.
    """
    P, X, GP, Ph, gain = state["P"], state["X"], state["GP"], state["Ph"], state["gain"]
    theta, n, p = state["theta"], len(GP), len(tuning["lower"])
    m = p + n
    S = tuning["variance"]
    for i in range(m):
        Ph[i] = 0.0
        for j in range(m):
            Ph[i] += P[i, j] * X[n, 1 + j]
        S += Ph[i] * X[n, 1 + i]
    for i in range(n):
        total = 0.0
        for j in range(m):
            total += X[i, 1 + j] * Ph[j]
            GP[i, j] = 0.0
            for q in range(m):
                GP[i, j] += X[i, 1 + q] * P[q, j]
        gain[p + i] = total / S
    for i in range(p):
        gain[i] = Ph[i] / S
    transport(P, GP, X, tuning["drift"], n, p)
    if valid:
        innovation = y - X[n, 0]
        for i in range(m):
            for j in range(i + 1):
                P[i, j] -= S * gain[i] * gain[j]
                P[j, i] = P[i, j]
        for i in range(n):
            X[i, 0] += gain[p + i] * innovation
        for i in range(p):
            theta[i] += gain[i] * innovation
    project(theta, tuning["lower"], tuning["upper"])


@jit
def project(theta, lower, upper):
    """Put the first of θ back into the box."""
    for i in range(len(lower)):
        if theta[i] < lower[i]:  # not min and max, which would hide a NaN
            theta[i] = lower[i]
        elif theta[i] > upper[i]:
            theta[i] = upper[i]


@jit
def transport(P, GP, X, W, n, p):  # noqa: PLR0917
    """P ← F P Fᵀ + W with F = [I 0; G], given G P; one triangle, mirrored."""
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for q in range(p + n):
                total += GP[i, q] * X[j, 1 + q]
            P[p + i, p + j] = P[p + j, p + i] = total
        for j in range(p):
            P[p + i, j] = P[j, p + i] = GP[i, j]
    for i in range(p):
        for j in range(p):
            P[i, j] += W[i, j]
