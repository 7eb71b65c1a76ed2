"""The recursive prediction-error method with a forgetting factor or covariance modification."""

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
    GRANTED,
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
    Internal variables of a filter, recorded over N samples.

    Attributes
    ----------
    theta : (N, p) array
        Parameter estimates after each sample.
    epsilon : (N,) array
        Residuals y − ŷ of equation (6).
    psi : (N, p) array
        Gradients of ŷ with respect to θ, as in equation (16), evaluated at the estimate before each
        sample.
    P : (N, p, p) array
        Matrices P(t+1|t) for a noise variance of one.
    covariance : (N, p) array
        Diagonals of the covariance that the filter claims for its estimates.
    """

    theta: Array
    epsilon: Array
    psi: Array
    P: Array
    covariance: Array


class Rpem(CompiledFilter):
    """
    Recursive prediction-error method with forgetting or covariance modification.

    The class implements equations (5)–(23) of *Recursive identification of physical parameters in a
    flexible robot arm* by Östring and Gunnarsson. The filter updates P by equation (13) if
    ``forgetting`` is given, or by equation (14) if ``drift`` is given. After the update of P by
    (13) or (14), the filter applies the regularisation (12).

    Parameters
    ----------
    model : Model
        Grey-box model of the axis, such as ``three_mass(nominal)``. If the model contains nonlinear
        torques, the filter propagates the sensitivities along the nonlinear trajectory.
    identify : sequence of str, optional
        Names of the identified parameters or inverse parameters. By default, the filter identifies
        the parameters in the model's attribute ``identify``. All parameters that are not identified
        keep their nominal values.
    theta0 : (p,) array_like, optional
        Initial parameter estimate θ(0); by default, the nominal values of the model.
    P0 : (p,) or (p, p) array_like
        Initial matrix P(0) or the diagonal of P(0), for a noise variance of one. The function
        `flexaxis.estimators.offline.priors.nominal_P` computes a suitable P(0).
    period : float
        Sampling period T [s].
    noise : float, optional
        Standard deviation of the noise in y, in the unit of y. By default, the filter estimates the
        noise from the residual.
    forgetting : float, optional
        Forgetting factor λ of equation (9) per sample, which is greater than 0 and at most 1. If
        neither ``forgetting`` nor ``drift`` is given, λ is 1 − T/(1 s), which corresponds to a time
        constant of 1 s.
    drift : (p,) or (p, p) array_like, optional
        Covariance Δ that equation (10) adds to P in every sample, or the diagonal of Δ.
    regularization : float or (p,) array_like
        Regularisation weight μ ≥ 0 of equation (12), as one common value or as one value for each
        parameter. If the filter uses a forgetting factor λ, the weight μ limits P to (1−λ)/μ.
    bounds : (lower, upper), optional
        Bounds to which the filter clips θ after every update, while P remains unchanged. By
        default, the bounds of θ are 0.1 and 10 times θ(0).
    output : {"speed", "increment", "angle"}
        Type of the output signal y: the motor speed at t_k, the increment (φ[k]−φ[k−1])/T of the
        motor angle, or the motor angle φ. The filter converts angles to angle increments.
    state_correction : bool
        Whether the filter corrects its state after every change Δθ of the estimate. The correction
        is x ← x + z Δθ, where z = ∂x/∂θ. To first order, the corrected state is the state that the
        new θ would have produced from past inputs. The original method of Östring and Gunnarsson
        does not correct the state. Without state correction, the estimate follows a parameter jump
        more slowly and with overshoot.
    robust : float
        Number of standard deviations to which residuals are clipped, such as 3, or 0 to disable
        clipping. Clipping prevents large estimation errors after an outlier, as described in
        *Robust estimation of a location parameter* (Huber, 1964). During the first 50 samples,
        while R̂ is still inaccurate, the clipping limit at the k-th sample is larger by a factor of
        (50/k)². If clipping is enabled, the filter also ignores the readings of a stuck or
        saturated sensor (`flexaxis.estimators.filters.fault_monitor`).
    ceiling : float
        Upper limit on the parameter variance R̂ P_ii relative to θ(0)², unless P(0) or a reset
        allows a larger variance. As long as R̂ is unknown, P_ii is limited to 100 P(0)_ii. The
        ceiling only has an effect if P becomes large, for example during a long standstill. The
        original method of Östring and Gunnarsson has no ceiling.
    rule : mapping of str to float, optional
        Number and options of another forgetting rule, as defined in
        `flexaxis.estimators.filters.forgetting`.

    Attributes
    ----------
    names : tuple of str
        Names of the p identified parameters.
    theta, psi : (p,) arrays
        Current parameter estimate, and gradient of ŷ at the previous estimate.
    P : (p, p) array
        Matrix P(t+1|t) for a noise variance of one. Assign a new value to P to reset the filter
        after a known parameter change.
    covariance : (p, p) array
        Covariance R̂ Σ that the filter claims for its estimate of a constant θ. The measurement
        update of Σ is Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ with the gain K = P(t|t) ψ. An assignment
        to P sets Σ to the same value. During slow, steady adaptation, the covariance Σ equals P/2.
        If ``noise`` is given, the noise variance R̂ is the square of ``noise``. Otherwise R̂ is a
        running mean of ε²/(1+ψᵀΣψ) with a memory of 2 s. The running mean R̂ starts at one and is
        updated only while the axis is excited.
    epsilon : float
        Residual y − ŷ, or NaN if the measurement is missing.
    prediction, innovation, innovation_variance, innovations : float or array
        Attributes inherited from `flexaxis.estimators.filters.filter.RecursiveEstimator`.

    Raises
    ------
    EstimatorError
        If an option is invalid. An estimate that diverges does not raise an error.

    Notes
    -----
    The estimate θ[k] depends on y[0..k] and u[0..k−1]. The torque u[k] is constant between t_k and
    t_{k+1}, so it first acts on y[k+1]. The sensitivities ∂x/∂θ of the state are zero before the
    first sample. Internally, all quantities refer to the relative parameters θ/θ(0), so the units
    and signs of the parameters do not matter.
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
        self.state["granted"] = np.maximum(np.diag(given), GRANTED * self.state["prior"])

    def restart(self, P: ArrayLike) -> None:
        """
        Restart the filter for a parameter change that is known to occur at the next sample.

        Let k₀ be the first sample with the new parameters. Call this method after sample k₀ − 1,
        the last sample with the old parameters. The output y[k₀] still depends only on the old
        parameters, whereas the torque from t_k₀ onwards acts on the axis with the new parameters.
        The method keeps the state of the axis but sets the sensitivities of the state to zero,
        because the state does not yet depend on the new θ.

        Parameters
        ----------
        P : (p,) or (p, p) array_like
            Covariance matrix of the new θ for a noise variance of one, or the diagonal of the
            matrix.
        """
        self.P = P
        self.state["X"][:, 1:] = 0.0

    @property
    def noise_variance(self) -> float:
        """Variance R̂ of the output noise, either specified or estimated from past samples."""
        return float(self.state["noise"])

    @property
    def psi(self) -> Array:  # noqa: D102
        return self.state["psi"] / self._design.scale

    @property
    def epsilon(self) -> float:  # noqa: D102
        return self.innovation

    def trace(self, u: Iterable[float], y: Iterable[float]) -> Trace:
        """Process samples, and return the internal filter variables after each sample."""
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
    Return the recursive prediction-error method with the forgetting factor λ of equation (13).

    Parameters
    ----------
    forgetting : float, optional
        Forgetting factor λ per sample.
    regularization : float
        Dimensionless regularisation factor m. The regularisation weights μ_i = m (1−λ)/P(0)_ii
        limit P_ii to P(0)_ii/m.
    state_correction, robust, ceiling : bool, float, float
        As for `Rpem`.
    """
    options = problem.forgetting_options("rpem-forgetting", forgetting)
    share = at_least_zero("regularization", regularization, "the regularisation factor")
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
    Return the recursive prediction-error method with covariance modification, as in equation (14).

    Parameters
    ----------
    scale : float
        Factor that multiplies the covariance Δ of equation (32).
    regularization : float
        Dimensionless regularisation factor m. The regularisation weights μ_i = m Δ_ii/P(0)_ii²
        limit P_ii to P(0)_ii/√m.
    robust, ceiling : float
        As for `Rpem`.
    """
    from flexaxis.estimators.offline import priors

    above_zero("scale", scale, "the factor that multiplies Δ")
    share = at_least_zero("regularization", regularization, "the regularisation factor")
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
        "recursive prediction-error method with a forgetting factor, equation (13)",
        rpem_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=1,
    ),
    Entry(
        "rpem-drift",
        "recursive prediction-error method with covariance modification, equations (14) and (32)",
        rpem_drift,
        knob="scale",
        default=1.0,
        rank=2,
    ),
)
