"""The joint extended Kalman filter in other libraries, on the same axis: extra `peers`.

Each has the state ξ = [θ; x] of `flexaxis.estimators.methods.ekf`, the same prior and the noise
told, so that their estimates are the same to rounding; how near they come stands in their rows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from speed_rounds import EXPM, IDENTIFY, Contender, Problem, timed

from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.models.discretisation import sampled_system

Array = NDArray[np.float64]
Filter = Callable[[Array, Array], Array]  # u, y (N,) -> θ (N, p)

OURS = "ekf-run"
FEW, REPEATS = 400, 3  # samples of the peers; runs of the whole record of ours
TERMS = 17  # of the exponential's series, by which JAX differentiates: to rounding for this axis


def peers(
    given: Problem, names: Sequence[str] | None = None
) -> tuple[list[Contender], dict[str, str]]:
    """Return our filter and those of the others, and why some are left out.

    Parameters
    ----------
    given : Problem
    names : sequence of str, optional
        Of `PEERS`; all by default.

    Returns
    -------
    contenders : list of Contender
        Their facts have `difference`, the largest from our estimates over the nominal value.
    missing : dict of str to str
        What does not run here, and why: not installed, or its own error.
    """
    ours = _ours(given)
    samples = REPEATS * len(given.u)
    u, y = given.u[:FEW], given.y[:FEW]
    reference = ours(u, y)
    found = [
        Contender(OURS, "joint_ekf().run, the noise told", EXPM, besides=OURS,
                  seconds=timed(lambda: [ours(given.u, given.y) for _ in range(REPEATS)], samples)),
    ]  # fmt: skip
    missing = {}
    for name in PEERS if names is None else names:
        what, make, clock = PEERS[name]
        try:
            run = make(given)
            off = np.abs(run(u, y) - reference) / np.abs(given.parametrization.theta)
        except ImportError as error:
            missing[name] = f"{error} (pip install -e '.[peers]' in the folder of flexaxis)"
            continue
        except Exception as error:  # a peer's release may break anything, and all else is measured
            missing[name] = f"{type(error).__name__}: {' '.join(str(error).split())}"
            continue
        seconds = timed(partial(run, u, y), FEW, clock)
        facts = {"difference": float(off.max())}
        found.append(Contender(name, what, EXPM, seconds, besides=OURS, facts=facts))
    return found, missing


def _ours(given: Problem) -> Filter:
    prior, drift = given.prior
    model, period = given.model, given.period
    told = {"P0": prior, "drift": drift, "period": period, "noise": given.noise}
    ekf = joint_ekf(make_design(model, identify=IDENTIFY, **told))

    def run(u: Array, y: Array) -> Array:
        ekf.reset()
        return ekf.run(u, y)

    return run


class Joint:
    """The model of ξ = [θ; x] by one matrix exponential a sample, for filters in NumPy.

    Attributes
    ----------
    start : ndarray (p+n,)
        ξ at the first sample.
    P0, W : ndarray (p+n, p+n)
        Its covariance, and what that gains in a sample.
    """

    def __init__(self, given: Problem) -> None:
        self._model, self._period = given.parametrization, given.period
        prior, drift = given.prior
        self.p, self.n = len(prior), self._model.n
        nothing = np.zeros(self.n)
        self.start = np.r_[self._model.theta, nothing]
        self.P0, self.W = np.diag(np.r_[prior, nothing]), np.diag(np.r_[drift, nothing])

    def move(self, xi: Array, u: float) -> tuple[Array, Array]:
        """Return ξ one sample later, the torque held, and the Jacobian of that."""
        p, n = self.p, self.n
        transition, gain, _ = sampled_system(self._model, xi[:p], self._period)
        F = np.eye(p + n)
        F[p:, p:] = transition[-n:, -n:]
        for i in range(p):  # block i of the extended system is the derivative by θ_i
            rows = slice(i * n, (i + 1) * n)
            F[p:, i] = transition[rows, -n:] @ xi[p:] + gain[rows] * u
        after = xi.copy()
        after[p:] = F[p:, p:] @ xi[p:] + gain[-n:] * u
        return after, F

    def output(self, xi: Array) -> Array:
        """Return the Jacobian (1, p+n) of the motor's speed, which does not depend on θ."""
        C = self._model.matrices(xi[: self.p])[2]
        return np.hstack([np.zeros((1, self.p)), C])


def _filterpy(given: Problem) -> Filter:
    from filterpy.kalman import ExtendedKalmanFilter

    joint = Joint(given)
    H = joint.output(joint.start)

    class Moving(ExtendedKalmanFilter):  # what its documentation says to override
        x: Array

        def predict_x(self, u: float = 0) -> None:
            self.x, self.F = joint.move(self.x, u)

    def run(u: Array, y: Array) -> Array:
        peer = Moving(dim_x=joint.p + joint.n, dim_z=1)
        peer.x, peer.P, peer.Q = joint.start.copy(), joint.P0.copy(), joint.W
        peer.R = np.array([[given.noise**2]])
        theta = np.empty((len(u), joint.p))
        for k, (torque, speed) in enumerate(zip(u, y, strict=True)):
            peer.update(np.array([speed]), lambda x: H, lambda x: H @ x)
            theta[k] = peer.x[: joint.p]
            peer.predict(torque)
        return theta

    return run


def _stone_soup(given: Problem) -> Filter:
    joint, noise = Joint(given), given.noise
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    axis = _moving(joint)
    place = int(np.flatnonzero(joint.output(joint.start)[0])[0])  # the motor's speed is a state
    speedometer = LinearGaussian(len(joint.start), (place,), np.array([[noise**2]]))
    predictor, updater = ExtendedKalmanPredictor(axis), ExtendedKalmanUpdater(speedometer)

    def run(u: Array, y: Array) -> Array:
        state: Any = GaussianState(joint.start[:, None], joint.P0)
        theta = np.empty((len(u), joint.p))
        for k, (torque, speed) in enumerate(zip(u, y, strict=True)):
            state = updater.update(SingleHypothesis(state, Detection(np.array([[speed]]))))
            theta[k] = np.asarray(state.state_vector, float)[: joint.p, 0]
            axis.torque = torque
            state = predictor.predict(state)
        return theta

    return run


def _moving(joint: Joint) -> Any:
    """Return ξ one sample later, at the `torque` that was last set, as one of its models."""
    from stonesoup.models.base import GaussianModel, TimeVariantModel
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.types.array import StateVector

    class Moving(TransitionModel, GaussianModel, TimeVariantModel):  # type: ignore[misc]
        torque = 0.0

        @property
        def ndim_state(self) -> int:
            return len(joint.start)

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            xi = np.asarray(state.state_vector, float)[:, 0]
            after, self._slope = joint.move(xi, self.torque)
            return StateVector(after)

        def jacobian(self, state: Any, **_: Any) -> Array:
            return self._slope  # asked for after the function, at the same state

        def covar(self, **_: Any) -> Array:
            return joint.W

    return Moving()


def _dynamax(given: Problem) -> Filter:
    import jax
    import jax.numpy as jnp
    from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter

    joint, model, period = Joint(given), given.parametrization, given.period
    p, n = joint.p, joint.n
    H = joint.output(joint.start)[0]
    exponent = model.exponent

    def move(xi: Any, torque: Any) -> Any:
        powers = jnp.where(exponent == 0, 1.0, xi[:p] ** exponent)
        terms = model.coefficient * jnp.prod(powers, axis=1)
        block = jnp.zeros((n + 1, n + 1)).at[model.row, model.column].add(terms)
        A, B = block[:n, :n], block[:n, n]
        x = v = jnp.append(xi[p:], torque[0])  # the held torque is one more state
        M = period * jnp.zeros((n + 1, n + 1)).at[:n].set(jnp.column_stack([A, B]))
        for k in range(1, TERMS + 1):
            v = M @ v / k
            x = x + v
        return jnp.append(xi[:p], x[:n])

    with jax.enable_x64(True):
        settings = ParamsNLGSSM(
            jnp.array(joint.start), jnp.array(joint.P0), move, jnp.array(joint.W),
            lambda xi, torque: jnp.atleast_1d(H @ xi), jnp.array([[given.noise**2]]),
        )  # fmt: skip

    @jax.jit
    def whole(u: Any, y: Any) -> Any:
        later = jnp.roll(u, 1)  # it moves to sample k+1 with the input of k+1
        found = extended_kalman_filter(
            settings, y[:, None], later[:, None], output_fields=["filtered_means"]
        )
        return found.filtered_means[:, :p]

    def run(u: Array, y: Array) -> Array:
        with jax.enable_x64(True):
            return np.asarray(whole(u, y))

    return run


PEERS: Mapping[str, tuple[str, Callable[[Problem], Filter], Any]] = {
    "ekf-filterpy": ("filterpy's ExtendedKalmanFilter, the model by one matrix exponential",
                     _filterpy, time.thread_time),
    "ekf-stone-soup": ("Stone Soup's ExtendedKalmanPredictor and -Updater, the model likewise",
                       _stone_soup, time.thread_time),
    "ekf-dynamax": ("dynamax's extended_kalman_filter, compiled as a whole by JAX for the CPU",
                    _dynamax, time.process_time),
}  # fmt: skip
"""Name, what it is, what makes it, and the clock: JAX works in threads of its own."""
