"""Axes that no scenario has, for docs/glr.py: of two masses, and sampled at 2 kHz.

They are simulated here in the shipped loop, the linear part exactly and Coulomb friction in steps
of .1 ms, and scored as docs/scores.md says.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from glr_runs import Row, said
from numpy.typing import NDArray
from scipy.linalg import expm

from flexaxis.estimators.models.axes import BRISTLES, N1, three_mass, two_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.running.estimators import make_estimator, parse
from flexaxis.experiments.scoring.bounds import cramer_rao, lag_bound
from flexaxis.experiments.scoring.true_model import jump_gradient
from flexaxis.sim.tables.controller import Controller, ControllerConfig
from flexaxis.sim.tables.excitation import Multisine

Array = NDArray[np.float64]


class Own(NamedTuple):
    """An axis that no scenario has: f_m × 1.5 after 10 of 20 s, in the shipped loop.

    Attributes
    ----------
    name : str
    model : Model
        What estimators are told, which is the truth before the fault.
    period : float
        [s].
    identify : tuple of str
    """

    name: str
    model: Model
    period: float
    identify: tuple[str, ...]


class Drawn(NamedTuple):
    """A run of an `Own` axis: torque and speed (N,), truth (N, p) and bound of the lag [s]."""

    torque: Array
    speed: Array
    truth: Array
    bound: float


SECONDS, AT, SIGMA, SHORT = 20.0, 10.0, 0.1, 1e-4
TWO = {"k_T": 1.0, "J_m": 1e-3, "J_l": 8e-4, "k": 8.0, "d": 2e-3, "f_m": 0.03, "f_l": 0.005}
DRY = {"f_c": 0.1, "sigma_0": 1000.0, "f_s": 0.0, "v_s": 0.0, "sigma_1": 0.0, "v_0": 0.0}
OWN: Sequence[Own] = (
    Own("two masses", two_mass(TWO), 0.005, ("k_T", "1/J_l", "f_m")),
    Own("two masses, f_c .1 N m", replace(two_mass(TWO | DRY), laws=(BRISTLES,)), 0.005,
        ("k_T", "1/J_l", "f_m", "f_c")),
    Own(".5 ms", three_mass(N1), 0.0005, ("k_T", "1/J_a", "f_m")),
)  # fmt: skip


def draw(own: Own, seed: int) -> Drawn:
    """Return a run of an axis that no scenario has."""
    rng = np.random.default_rng([seed, 78])
    N, first = round(SECONDS / own.period), round(AT / own.period)
    once = Multisine().one_period(rng, own.period)
    loop = Controller(ControllerConfig(), 1, period=own.period)
    known = own.model.nominal
    before, after = own.model, replace(own.model, nominal={**known, "f_m": 1.5 * known["f_m"]})
    moved = mover(before, own.period)
    u, v, x, angle = np.zeros(N), np.zeros(N), np.zeros(len(own.model.A)), 0.0
    motor, dry = own.model.states.index("speed_motor"), 0.0
    for k in range(N):
        if k == first:
            moved, start = mover(after, own.period), np.r_[x, [dry] * len(own.model.laws)]
        v[k] = x[motor]
        u[k] = loop.torque(once[[k % len(once)]], np.array([angle]))[0]
        x, turned, dry = moved(x, u[k])
        angle += turned
    model = after.parametrize(own.identify)
    stop = first + round(5.0 / own.period)
    psi = jump_gradient(model, model.theta, u[first:stop], start, period=own.period)
    deviation = np.sqrt(cramer_rao(psi, SIGMA**2, model.theta)[:, 2, 2])
    truth = np.tile(before.parametrize(own.identify).theta, (N, 1))
    truth[first:] = model.theta
    bound = lag_bound(deviation, truth[-1, 2] - truth[0, 2], period=own.period)
    return Drawn(u, v + SIGMA * rng.standard_normal(N), truth, bound)


def matrices(model: Model) -> tuple[Array, Array]:
    """Return A (n, n) and B (n, 1) of the linear part of a model."""
    linear = replace(model, laws=()).parametrize(("k_T",))
    return linear.matrices(linear.theta)[:2]


def mover(model: Model, period: float) -> Callable[[Array, float], tuple[Array, float, float]]:
    """Return what takes a state over a sample, with the angle turned and the dry friction."""
    level, motor = model.nominal.get("f_c", 0.0), model.states.index("speed_motor")
    A, B = matrices(model)
    n, steps = len(A), round(period / SHORT) if level else 1
    push = np.zeros((n, 1))
    push[motor] = -1 / model.nominal["J_m"]
    whole = np.zeros((n + 3, n + 3))  # state, angle, torque, friction
    whole[:n, :n], whole[:n, n + 1 : n + 2], whole[:n, n + 2 :] = A, B, push
    whole[n, motor] = 1.0
    step = expm(whole * period / steps)

    def moved(x: Array, u: float) -> tuple[Array, float, float]:
        z, friction = np.r_[x, 0.0, u, 0.0], 0.0
        for _ in range(steps):
            z[n + 2] = 0.0
            if level:  # as much as stops it, and no more
                friction = np.clip(-(step[motor] @ z) / step[motor, n + 2], -level, level)
                z[n + 2] = friction
            z = step @ z
        return z[:n], float(z[n]), float(friction)

    return moved


def run_own(name: str, text: str, seed: int) -> Row:
    """Return the same of an axis that no scenario has."""
    own = next(o for o in OWN if o.name == name)
    drawn, spec = draw(own, seed), parse(text)
    offered = {"identify": own.identify, "output": "speed", "torque": drawn.torque[:8000]}
    estimator = make_estimator(spec, own.model, own.period, **offered)
    theta, T = run_estimator(estimator, drawn.torque, drawn.speed, None), own.period
    first, lost = round(AT / T), not np.isfinite(theta).all()
    window, told = range(first, first + round(5 / T)), getattr(estimator, "findings", None)
    findings = [(f, *said(f)) for f in told or ()]
    mine = [f for f in findings if f[0].alarm in window]
    fault: Row = {"fault": "f_m", "more": max(0, len(mine) - 1)}
    if mine:
        fault |= {"named": mine[0][1], "delay": T * (mine[0][0].alarm - first)}
    return {"us": np.nan, "claims": [{}] * 4, "findings": len(findings), "calm": 15.0,
            "false": [False for f in findings if f[0].alarm not in window],
            "faults": [] if told is None else [fault],
            "rows": [own_row(n, theta[:, list(estimator.names).index(n)], drawn.truth[:, i], window)
                     | {"lag_bound": drawn.bound, "diverged": lost, "lost_before": lost}
                     for i, n in enumerate(own.identify) if n in estimator.names]}  # fmt: skip


def own_row(name: str, theta: Any, truth: Any, window: range) -> Row:
    """Return the scores of a parameter, as docs/scores.md defines them, of such an axis."""
    error, D = theta - truth, truth[-1] - truth[0]
    part, per = np.s_[window.start : window.stop], 100 / truth[0]
    before = per * error[window.start // 2 : window.start]
    lag = 5.0 / len(window) * np.sum(np.minimum(abs(error[part]) / D, 10)) if D else None
    talk = None if D else per * float(np.sqrt(np.mean(error[part] ** 2)))
    return {"parameter": name, "changed": bool(D), "lag": lag, "bias": float(before.mean()),
            "std": float(np.sqrt(np.mean(before**2))), "cross_talk": talk}  # fmt: skip
