"""The paper's recursive prediction-error method, compiled."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design, covariance_matrix, make_design
from flexaxis.estimators.recursion.kernel import rpem_loop, state_type, tuning_type
from flexaxis.estimators.recursion.noise import MEMORY
from flexaxis.estimators.recursion.trace import Trace, trace
from flexaxis.estimators.sampling.pattern import Pattern, split
from flexaxis.estimators.sampling.plan import MAX_ORDER, plan
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]


class Rpem:
    """
    Recursive prediction-error method with forgetting or covariance modification.

    Eq. (5)–(23) of Östring and Gunnarsson, *Recursive identification of physical parameters in a
    flexible robot arm*: (13) with ``forgetting``, (14) with ``drift``, both followed by (12).

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    identify : sequence of str
        Parameters to estimate, or their inverses; all others stay at the model's nominal values.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        P(0), for a noise variance of one; see `flexaxis.estimators.offline.priors.nominal_P`.
    period : float
        Sampling period T [s].
    forgetting : float, optional
        Forgetting factor λ in (0, 1], eq. (9); 0.995 where neither it nor ``drift`` is given.
    drift : (p,) or (p, p) array_like, optional
        Δ, the covariance that P gains in every sample, eq. (10).
    regularization : float
        μ ≥ 0, eq. (12); keeps P ≤ (1−λ)/μ with forgetting.
    bounds : (lower, upper), optional
        Box on which θ is projected after every update, P left alone; 0.1 to 10 times θ(0) by
        default.
    output : {"speed", "increment"}
        What y is: the motor speed at t_k, or the increment (φ[k]−φ[k−1])/T of the motor angle.

    state_correction : bool
        Whether the state follows every change of θ, x ← x + z Δθ with z = ∂x/∂θ, so that it is
        what the new θ would have made of the past. Not in the paper, whose state keeps what the
        old estimates did to it; without it a jump is followed more slowly and with overshoot.
    robust : float
        Standard deviations, 3 say, beyond which a residual counts as one of that size, so that
        an outlier cannot throw the estimate (Huber's influence function; P. J. Huber, *Robust
        estimation of a location parameter*, Ann. Math. Stat. 35, 1964). The first 50 samples are
        not judged, as the running noise variance is not known yet; 0 for never.

    Attributes
    ----------
    names : tuple of str
        The identified parameters.
    bounds : tuple of arrays
        The box in use.
    theta, psi : (p,) arrays
        The estimate, and the gradient of ŷ at the estimate before.
    P : (p, p) array
        P(t+1|t), for a noise variance of one; set it to reset the filter after a known change.
    covariance : (p, p) array
        Claimed covariance of the estimate, R̂ P/2. The half is that of slow adaptation, where P
        holds one more factor than the variance of the estimate; R̂ is a running mean of
        ε²/(1+ψᵀPψ) with a memory of 400 samples, and one before the first measurement.
    epsilon : float
        Residual y − ŷ; NaN in a gap.

    Raises
    ------
    EstimatorError
        If an option cannot be used. An estimate that diverges is a result and no error.

    Notes
    -----
    θ[k] uses y[0..k] and u[0..k−1]; u[k] is held on [t_k, t_{k+1}) and first acts on y[k+1]. The
    axis is at rest before the first sample: x = 0, and so are the sensitivities.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float = 0.005,
        forgetting: float | None = None,
        drift: ArrayLike | None = None,
        regularization: float = 0.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
        state_correction: bool = False,
        robust: float = 0.0,
    ) -> None:
        self._design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting,
            drift=drift,
            regularization=regularization,
            bounds=bounds,
            output=output,
        )
        self.names, self.output = self._design.model.names, output
        self.bounds = self._design.lower, self._design.upper
        pattern, coefficients = split(self._design.model)
        self._tuning, self._start = filter_records(self._design, pattern, coefficients)
        self._tuning["correct"] = float(state_correction)
        if not (np.isfinite(robust) and robust >= 0):
            raise EstimatorError(f"robust is {robust}; give standard deviations, such as 3, or 0")
        self._tuning["clip"] = float(robust)
        self._loop = rpem_loop(pattern)
        self._sample = np.empty(1), np.empty(1), np.empty(1, bool), np.empty((1, len(self.names)))
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._state = self._start.copy()

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._state["theta"][0].copy()

    @property
    def P(self) -> Array:  # noqa: D102
        return self._state["P"][0].copy()

    @P.setter
    def P(self, value: ArrayLike) -> None:
        self._state["P"][0] = covariance_matrix("P", value, len(self.names))

    def restart(self, P: ArrayLike) -> None:
        """
        Begin anew after a change that is known to have happened at the last sample.

        The state stays, but its sensitivities become zero: it does not depend on the new θ yet.

        Parameters
        ----------
        P : (p,) or (p, p) array_like
            What is known of the new θ, for a noise variance of one.
        """
        self.P = P
        self._state["X"][0, :, 1:] = 0.0

    @property
    def psi(self) -> Array:  # noqa: D102
        return self._state["psi"][0].copy()

    @property
    def epsilon(self) -> float:  # noqa: D102
        return float(self._state["epsilon"][0])

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._state["noise"][0] * self._state["P"][0] / 2

    def step(self, u: float, y: float | None) -> Array:
        """
        Take one sample.

        Parameters
        ----------
        u : float
            Torque held from t_k on.
        y : float or None
            Output measured at t_k; None in a gap, where P follows its time update only.

        Returns
        -------
        (p,) array
            θ[k].
        """
        check_sample(u, y)
        sample = self._sample
        sample[0][0], sample[2][0] = u, y is not None
        if y is not None:
            sample[1][0] = y
        self._loop(self._tuning, self._state, *sample)
        return sample[3][0].copy()

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Take N samples, from the current state on.

        Parameters
        ----------
        u, y : (N,) array_like
        valid : (N,) array_like of bool, optional
            False where y is missing.

        Returns
        -------
        (N, p) array
            θ[0], θ[1], …
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), len(self.names)))
        self._loop(self._tuning, self._state, u, y, present, estimates)
        return estimates

    def trace(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Trace:
        """Do as ``run`` and keep residual, gradient and P of every sample."""
        return trace(self, u, y, valid)


def filter_records(
    design: Design, pattern: Pattern, coefficients: Array
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return tuning and start of a filter, as records for the compiled loop."""
    order, substeps = plan(design.model, design.lower, design.upper, design.period)
    row, column, _ = np.array(pattern.entries).T
    scale = np.where(row < pattern.n, design.period / substeps, 1.0)  # the output is read, not run

    tuning = np.zeros(1, tuning_type(pattern))
    tuning["coefficients"] = coefficients * scale[[entry for entry, *_ in pattern.terms]]
    tuning["weights"] = 1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1))
    tuning["order"], tuning["substeps"] = order, substeps
    tuning["forgetting"], tuning["drift"] = design.forgetting, design.drift
    tuning["regularization"] = design.regularization
    tuning["lower"], tuning["upper"] = design.lower, design.upper
    tuning["memory"] = MEMORY

    state = np.zeros(1, state_type(pattern))
    state["theta"], state["P"] = design.theta0, design.P0
    blocks = design.model.blocks(design.theta0)
    state["M"][0, :, : len(blocks)] = (blocks[:, row, column] * scale).T
    state["epsilon"], state["noise"] = np.nan, 1.0
    return tuning, state
