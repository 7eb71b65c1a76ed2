"""The paper's recursive prediction-error method, with a forgetting factor or with drift."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import (
    above_zero,
    at_least_zero,
    covariance_matrix,
    flag,
    make_design,
)
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.prediction_error import (
    CALM,
    CEILING,
    ROBUST,
    read_claim,
    recursion,
)
from flexaxis.estimators.methods import loops
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

Array = NDArray[np.float64]


class Trace(NamedTuple):
    """
    Internal variables of a filter over N samples.

    Attributes
    ----------
    theta : (N, p) array
        Estimates after each sample.
    epsilon : (N,) array
        Residuals y − ŷ, eq. (6).
    psi : (N, p) array
        Gradients of ŷ with respect to θ at the estimate before each sample, eq. (16).
    P : (N, p, p) array
        Matrices P(t+1|t), for a noise variance of one.
    covariance : (N, p) array
        Diagonals of the claimed covariance of the estimates.
    """

    theta: Array
    epsilon: Array
    psi: Array
    P: Array
    covariance: Array


class Rpem(CompiledFilter):
    """
    Recursive prediction-error method with forgetting or covariance modification.

    The class implements eq. (5)–(23) of Östring and Gunnarsson, *Recursive identification of
    physical parameters in a flexible robot arm*. P is updated by eq. (13) if ``forgetting`` is
    given and by eq. (14) if ``drift`` is given. Both updates are followed by eq. (12).

    Parameters
    ----------
    model : Model
        Grey-box model, such as ``three_mass(nominal)``. If the model contains nonlinear laws, the
        sensitivities are propagated along the nonlinear trajectory.
    identify : sequence of str, optional
        Names of the parameters to estimate, or of their inverses. The default is the model's
        attribute ``identify``. All other parameters keep their nominal values.
    theta0 : (p,) array_like, optional
        Initial estimate θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        Initial matrix P(0) or its diagonal, for a noise variance of one; see
        `flexaxis.estimators.offline.priors.nominal_P`.
    period : float
        Sampling period T [s].
    noise : float, optional
        Standard deviation of the noise of y, in the unit of y. By default, it is estimated from the
        residual.
    forgetting : float, optional
        Forgetting factor λ in (0, 1] per sample, eq. (9). If neither ``forgetting`` nor ``drift``
        is given, λ = 1 − T/(1 s), which corresponds to a time constant of 1 s.
    drift : (p,) or (p, p) array_like, optional
        Covariance Δ that is added to P in every sample, eq. (10), or the diagonal of Δ.
    regularization : float or (p,) array_like
        Weight μ ≥ 0 of eq. (12), either one value or one value per parameter. With forgetting, the
        weight keeps P ≤ (1−λ)/μ.
    bounds : (lower, upper), optional
        Bounds to which θ is clipped after every update, without a change of P; 0.1 to 10 times θ(0)
        by default.
    output : {"speed", "increment", "angle"}
        Kind of signal y: the motor speed at t_k, the increment (φ[k]−φ[k−1])/T of the motor angle,
        or the motor angle φ. The method converts angles to increments.
    state_correction : bool
        Whether the state is corrected for every change of θ, x ← x + z Δθ with z = ∂x/∂θ. To first
        order, the corrected state is the one that the new θ would have produced from past inputs.
        The paper does not correct the state. Without this correction, the estimate follows a jump
        more slowly and with overshoot.
    robust : float
        Number of standard deviations to which residuals are clipped, such as 3; 0 for no limit.
        Clipping prevents a large error of the estimate after an outlier (Huber's influence
        function; P. J. Huber, *Robust estimation of a location parameter*, Ann. Math. Stat. 35,
        1964). In the first 50 samples, when R̂ is the mean of k residuals, the limit is larger by a
        factor of (50/k)². If residuals are clipped, the filter also ignores the readings of a stuck
        or saturated sensor; see `flexaxis.estimators.filters.fault_monitor`.
    ceiling : float
        Largest variance R̂ P_ii of a parameter relative to θ(0)², unless P(0) or a reset allows a
        larger variance. Until R̂ is known, the limit is P_ii ≤ 100 P(0)_ii. The ceiling has no
        effect unless P reaches it, for example during a long standstill. The paper's original
        method has an infinite ceiling.
    rule : mapping of str to float, optional
        Number and options of another rule of forgetting; see
        `flexaxis.estimators.filters.forgetting`.

    Attributes
    ----------
    names : tuple of str
        Names of the p identified parameters.
    theta, psi : (p,) arrays
        Current estimate, and gradient of ŷ at the previous estimate.
    P : (p, p) array
        Matrix P(t+1|t), for a noise variance of one. Assign a new value to reset the filter after a
        known change.
    covariance : (p, p) array
        Covariance R̂ Σ that the filter claims for its estimate of a constant θ, with
        Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ and K = P(t|t) ψ. Assigning P also sets Σ = P. In slow,
        steady adaptation Σ equals P/2. R̂ is the square of ``noise`` or a running mean of
        ε²/(1+ψᵀΣψ) with a memory of 2 s. R̂ is one before the first measurement, and is updated only
        while the axis is excited.
    epsilon : float
        Residual y − ŷ; NaN if the measurement is missing.
    prediction, innovation, innovation_variance, innovations
        Attributes of `flexaxis.estimators.filters.filter.RecursiveEstimator`.

    Raises
    ------
    EstimatorError
        If an option is invalid. A diverging estimate does not raise an error.

    Notes
    -----
    θ[k] depends on y[0..k] and u[0..k−1]; u[k] is held on [t_k, t_{k+1}) and first acts on y[k+1].
    The sensitivities are zero before the first sample. Internally, all quantities are expressed in
    θ/θ(0), so the units and signs of the parameters do not matter.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float,
        noise: float | None = None,
        forgetting: float | None = None,
        drift: ArrayLike | None = None,
        regularization: ArrayLike = 0.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
        state_correction: bool = False,
        robust: float = 0.0,
        ceiling: float = CEILING,
        rule: Mapping[str, float] | None = None,
    ) -> None:
        design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            noise=noise,
            forgetting=forgetting,
            drift=drift,
            regularization=regularization,
            bounds=bounds,
            output=output,
        )
        start = recursion(
            design,
            robust=robust,
            ceiling=ceiling,
            correct=flag("state_correction", state_correction),
            **(rule or {}),
        )
        super().__init__(loops.rpem, start, design, read_claim)

    @property
    def P(self) -> Array:  # noqa: D102
        return self.state["P"] * np.outer(self._design.scale, self._design.scale)

    @P.setter
    def P(self, value: ArrayLike) -> None:
        squares = np.outer(self._design.scale, self._design.scale)
        given = covariance_matrix("P", value, len(squares)) / squares
        self.state["P"] = self.state["claim"] = given
        self.state["granted"] = np.diag(given)

    def restart(self, P: ArrayLike) -> None:
        """
        Restart the filter for a change that is known to happen at the next sample.

        Let k₀ be the first sample with the new parameters. Call this method after sample k₀ − 1.
        y[k₀] still depends on the old parameters only, and the torque that is held from t_k₀ on
        acts on the new parameters. The state is kept, but its sensitivities are set to zero,
        because the state does not depend on the new θ yet.

        Parameters
        ----------
        P : (p,) or (p, p) array_like
            Covariance of the new θ or its diagonal, for a noise variance of one.
        """
        self.P = P
        self.state["X"][:, 1:] = 0.0

    @property
    def noise_variance(self) -> float:
        """Variance R̂ of the output noise, either specified or estimated so far."""
        return float(self.state["noise"])

    @property
    def psi(self) -> Array:  # noqa: D102
        return self.state["psi"] / self._design.scale

    @property
    def epsilon(self) -> float:  # noqa: D102
        return self.innovation

    def trace(self, u: Iterable[float], y: Iterable[float]) -> Trace:
        """Process samples and return the internal variables of the filter after each sample."""
        rows = [
            (self.step(*sample), self.epsilon, self.psi, self.P, np.diag(self.covariance))
            for sample in zip(u, y, strict=True)
        ]
        return Trace(*map(np.array, zip(*rows, strict=True)))


def rpem_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    regularization: float = 0.0,
    state_correction: bool = False,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> Rpem:
    """
    Return the paper's method with the forgetting factor λ, eq. (13).

    Parameters
    ----------
    forgetting : float, optional
        Forgetting factor λ per sample.
    regularization : float
        Dimensionless factor m of μ_i = m (1−λ)/P(0)_ii, which keeps P_ii below P(0)_ii/m.
    state_correction, robust, ceiling
        Options of `Rpem`.
    """
    options = problem.forgetting_options("rpem-forgetting", forgetting)
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    diagonal = np.diag(covariance_matrix("P0", options["P0"], len(problem.identify)))
    return Rpem(
        problem.model,
        **options,
        regularization=share * (1 - options["forgetting"]) / diagonal,
        state_correction=state_correction,
        robust=robust,
        ceiling=ceiling,
    )


def rpem_drift(
    problem: Problem,
    *,
    scale: float = 1.0,
    regularization: float = 0.0,
    robust: float = ROBUST,
    ceiling: float = 10 * CALM,
) -> Rpem:
    """
    Return the paper's method with covariance modification, eq. (14), by a multiple of Δ, eq. (32).

    Parameters
    ----------
    scale : float
        Factor by which Δ is multiplied.
    regularization : float
        Dimensionless factor m of μ_i = m Δ_ii/P(0)_ii², which keeps P_ii below P(0)_ii/√m.
    robust, ceiling
        Options of `Rpem`.
    """
    from flexaxis.estimators.offline import priors

    above_zero("scale", scale, "the factor on Δ")
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    axis = problem.model, problem.identify, problem.period
    drift = scale * priors.default_drift(*axis, torque=problem.torque, output=problem.output)
    P = problem.initial_P(drift=drift, scale=scale)
    diagonal = np.diag(covariance_matrix("P0", P, len(problem.identify)))
    return Rpem(
        problem.model,
        **problem.asked,
        P0=P,
        drift=drift,
        regularization=share * drift / diagonal**2,
        robust=robust,
        ceiling=ceiling,
    )


ENTRIES = (
    Entry(
        "rpem-forgetting",
        "the paper's method with a forgetting factor, eq. (13)",
        rpem_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=1,
    ),
    Entry(
        "rpem-drift",
        "the paper's method with covariance modification, eq. (14), (32)",
        rpem_drift,
        knob="scale",
        default=1.0,
        rank=2,
    ),
)
