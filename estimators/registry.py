"""The estimators by name: one entry each, with its options and the knob that trades its speed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.methods.recipes import (
    DEFAULT_IDENTIFY,
    frozen,
    oracle_reset,
    relocate,
    rpem_drift,
    rpem_forgetting,
)
from flexaxis.estimators.methods.rivals import forgetful, horizon, imm, joint
from flexaxis.estimators.tuned import tuned

if TYPE_CHECKING:
    from flexaxis.estimators.protocol import Estimator

__all__ = ["DEFAULT_IDENTIFY", "REGISTRY", "Entry", "entry", "oracle_reset", "rpem_forgetting"]

REGULARIZATION = 0.3
"""
μ of the ``-mu`` entries, chosen for the nominal axis in stop-and-go operation.

Simulated: 10 s of excitation, 20 s of standstill with f_m +50 % inside it, then excitation again;
λ = 0.995. Without μ the standstill takes P to 1e5 and the restart throws an estimate to hundreds of
times its value, if the box lets it. μ = 0.3 keeps P below (1−λ)/μ = 0.017, no other parameter
leaves its value by more than 2.5 % at the restart (30 % at μ = 1e-3), the lag of f_m is within
0.01 s of the best μ, and the standard deviations without a pause fall by less than 1.5 % (4 % at
μ = 1). It is meant for parameters of the order of one; scale it for others, as 1/θ².
"""


@dataclass(frozen=True)
class Entry:
    """
    A registered estimator.

    Attributes
    ----------
    name : str
    summary : str
        One line for lists and reports.
    factory : callable
        ``factory(nominal, period, *, identify, output, P0=None, torque=None, <options>)``. θ(0) is
        read from ``nominal``, a mapping of physical parameters to values for the paper's axis, or
        another model with its own; ``P0`` is used if given, else the paper's recipe on ``torque``,
        the (N,) torque of a nominal run, else the known P(0) of the paper's three parameters.
    options : mapping
        Names of the options with their defaults.
    knob : str or None
        The option that trades tracking speed against variance.
    """

    name: str
    summary: str
    factory: Callable[..., "Estimator"]
    options: Mapping[str, float]
    knob: str | None = None


def entry(name: str) -> Entry:
    """
    Return the registered estimator of this name.

    Raises
    ------
    EstimatorError
        If there is none, with the nearest name.
    """
    if name not in REGISTRY:
        raise EstimatorError(f"unknown estimator {name!r}: {did_you_mean(name, REGISTRY)}")
    return REGISTRY[name]


def _tuned(
    name: str, summary: str, factory: Callable[..., "Estimator"], options: Mapping[str, float]
) -> Entry:
    """Return an entry whose knob, the first option, has the value found by `flexaxis tune`."""
    knob = next(iter(options))
    value = tuned(name, otherwise=options[knob])
    return Entry(name, summary, partial(factory, **{knob: value}), {**options, knob: value}, knob)


REGISTRY: Mapping[str, Entry] = {
    entry.name: entry
    for entry in (
        Entry(
            "rpem-forgetting",
            "the paper's method with a forgetting factor, eq. (13)",
            rpem_forgetting,
            {"forgetting": 0.995, "regularization": 0.0},
            "forgetting",
        ),
        Entry(
            "rpem-drift",
            "the paper's method with covariance modification, eq. (14), (32)",
            rpem_drift,
            {"scale": 1.0, "regularization": 0.0},
            "scale",
        ),
        Entry(
            "rpem-forgetting-mu",
            "rpem-forgetting, regularised against standstill, eq. (12)",
            partial(rpem_forgetting, regularization=REGULARIZATION),
            {"forgetting": 0.995, "regularization": REGULARIZATION},
            "forgetting",
        ),
        Entry(
            "rpem-drift-mu",
            "rpem-drift, regularised against standstill, eq. (12)",
            partial(rpem_drift, regularization=REGULARIZATION),
            {"scale": 1.0, "regularization": REGULARIZATION},
            "scale",
        ),
        _tuned(
            "rpem-corrected",
            "rpem-forgetting whose state follows every change of its parameters",
            partial(rpem_forgetting, state_correction=True),
            {"forgetting": 0.995, "regularization": 0.0},
        ),
        Entry(
            "literal-rpem",
            "rpem-forgetting with a matrix exponential in every sample: slow, the oracle",
            partial(rpem_forgetting, literal=True),
            {"forgetting": 0.995, "regularization": 0.0},
            "forgetting",
        ),
        _tuned(
            "ekf",
            "joint extended Kalman filter for state and parameters",
            joint,
            {"walk": 0.002, "spread": 0.2},
        ),
        _tuned(
            "ukf",
            "joint unscented Kalman filter for state and parameters, in square-root form",
            partial(joint, unscented=True),
            {"walk": 0.002, "spread": 0.2},
        ),
        _tuned(
            "imm",
            "interacting multiple models: joint Kalman filters, a quiet one and one for each jump",
            imm,
            {"walk": 0.0015, "spread": 0.2, "jump": 0.1581, "rate": 1e-3, "hold": 0.05},
        ),
        _tuned(
            "moving-horizon",
            "nonlinear least squares over a moving window, with an arrival cost",
            horizon,
            {"forgetting": 0.994, "window": 1.0, "every": 0.05},
        ),
        *(
            _tuned(name, summary, partial(forgetful, rule=rule), {"forgetting": 0.995})
            for name, rule, summary in (
                ("vector-forgetting", "vector", "a forgetting factor for each parameter"),
                ("directional-forgetting", "directional", "forgets along the gradient only (SIFt)"),
                ("efra", "efra", "exponential forgetting and resetting, P bounded on both sides"),
                ("variable-forgetting", "variable", "forgets while the residual is large"),
            )
        ),
        _tuned(
            "cusum-reset",
            "rpem-forgetting whose P is reset when a CUSUM on the residual raises an alarm",
            partial(forgetful, rule="cusum"),
            {"forgetting": 0.995, "reset": 0.1, "level": 10.0},
        ),
        Entry(
            "relocate",
            "detects a jump, rewinds to it and refits whichever physical parameter explains it",
            relocate,
            {"forgetting": 0.995, "alarm": 10.0, "gain": 14.0},
            "forgetting",
        ),
        Entry(
            "oracle-reset",
            "a control that is told when a fault happens, and begins anew there",
            oracle_reset,
            {"forgetting": 0.995},
            "forgetting",
        ),
        Entry("frozen", "never moves: what doing nothing scores", frozen, {}),
    )
}
