"""The joint extended Kalman filter in Stone Soup, whose filters ask for models of their classes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from flexaxis.experiments.speed.peers import Joint

Array = NDArray[np.float64]


def stone_soup(joint: Joint, noise: float) -> Callable[[Array, Array], Array]:
    """Return the filter: u, y (N,) -> θ (N, p).

    Parameters
    ----------
    joint : Joint
        The model of ξ = [θ; x].
    noise : float
        Standard deviation of y.

    Raises
    ------
    ImportError
        If Stone Soup is not installed.
    """
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
