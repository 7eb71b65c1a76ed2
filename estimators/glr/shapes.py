"""Which shape of the dictionary is taken up after the first seconds, and into which filter."""

from typing import NamedTuple

import numpy as np

from flexaxis.estimators.filters.loop import Record
from flexaxis.estimators.glr.workspace import Workspace
from flexaxis.estimators.models.laws import LAWS

ALARM = 20.0  # nats by which a shape explains more than it costs: three times those of a jump, as
# it stays for good, and as friction that is still being learnt makes columns wrong
LINE, WAVES, SIDES = 0, 1, 2  # which shape the law is told to be
GEAR = 3  # none of these, but a law in the place of dry friction
WHICH = list(LAWS["shape"].roles).index("which")
IN_WORDS = {
    LINE: "a torque over the angle of the motor, such as cogging",
    WAVES: "dry friction that depends on the angle of the motor",
    SIDES: "dry friction that is larger one way, or grows with the load",
    GEAR: "friction of the gear, of which each torque there has its share",
}
SINGLE = 2  # columns before those of waves
FASTEST = 2.0  # radians that a wave may turn in a period at the rms speed; torques of faster ones
# are gone from their mean over the period


class _Shape(NamedTuple):
    """
    A torque that the model lacks: `which` of the law, its waves in a turn, its coefficients.

    Attributes
    ----------
    which : int
    n : float
    a, b : float
        [N m].
    gain : float
        Nats by which it explains more than it costs.
    """

    which: int
    n: float
    a: float
    b: float
    gain: float


def best_shape(bank: Record, tuning: Record, variance: float) -> _Shape | None:
    """
    Return what of the dictionary explains the first seconds best, or None.

    A shape leaves χ² − Δ of the χ² of n samples, whose scale nobody knows: its evidence is
    ½ n ln(χ²/(χ² − Δ)), less ½ ln n for each number that is unknown, and the logarithm of how many
    shapes there are. Successive innovations that it leaves may repeat each other: with their
    correlation ρ as many as (1+ρ)/(1−ρ) count as one. What it explains is taken to repeat itself.

    Parameters
    ----------
    bank, tuning : records
    variance : float
        Of coefficients [(N m)²].
    """
    K, chi2, used = int(tuning["waves"]), float(bank["chi2"]), float(bank["used"])
    if not K or used < SINGLE or not chi2 > 0:
        return None
    firsts = np.r_[0, SINGLE + 2 * np.arange(2 * K)]
    J, d, cross = bank["J"], bank["d"], bank["cross"]
    A = np.empty((len(firsts), 2, 2))
    A[:, 0, 0], A[:, 1, 1], A[:, 0, 1] = J[firsts], J[firsts + 1], cross[firsts]
    A[:, 1, 0] = A[:, 0, 1]
    rhs = np.stack([d[firsts], d[firsts + 1]], axis=-1)
    A += np.eye(2) * max(1.0, chi2 / used) / variance
    size = np.linalg.solve(A, rhs[..., None])[..., 0]
    explained = np.minimum((size * rhs).sum(axis=1), (1 - 1 / used) * chi2)
    left = chi2 - explained
    rho = np.clip((bank["repeated"] - explained) / left, 0.0, 0.95)
    n = used * (1 - rho) / (1 + rho)
    unknown = np.where(np.arange(len(firsts)) == 0, 2, 3)  # two coefficients, and the waves
    gain = 0.5 * n * np.log(chi2 / left) - 0.5 * unknown * np.log(n) - np.log(len(firsts))
    best = int(np.argmax(gain))
    if not gain[best] > ALARM:
        return None
    a, b = size[best].tolist()
    if best == 0:
        return _Shape(SIDES, 1.0 / float(tuning["load_size"]), b, a, float(gain[best]))
    return _Shape((best - 1) % 2, (best - 1) // 2 + 1.0, a, b, float(gain[best]))


def fastest_wave(speed: float, period: float) -> int:
    """Return the most waves in a turn that torques are looked for with."""
    return max(1, int(FASTEST / (speed * period)))


def taken_up(plain: Workspace, rich: Workspace, shape: _Shape) -> None:
    """
    Let a filter that has one shape more begin where another one is.

    Parameters
    ----------
    plain : Workspace
        After the first seconds.
    rich : Workspace
        As before the first sample. Its parameters are those of the other and, as the last three,
        those of the shape, which is its last law; it may have the angle as one more state.
    shape : _Shape
    """
    _told(rich, shape)
    share(plain.bank, rich.bank)
    share(plain.states, rich.states)
    was, now, p = plain.states[0], rich.states[0], plain.p
    n, more = len(was["gain"]) - p, len(now["gain"]) - rich.p - len(was["gain"]) + p
    angle = rich.angle
    rows = np.arange(n) + np.where(np.arange(n) >= angle, more, 0)
    whole = np.r_[np.arange(p), rich.p + rows]
    now["P"][np.ix_(whole, whole)] = was["P"][:, : p + n]
    now["theta"][:p] = was["theta"][:p]
    now["theta"][p : p + 2] = np.array([shape.a, shape.b]) / rich.design.scale[p : p + 2]
    now["X"][rows, 0], now["X"][-1, 0] = was["X"][:n, 0], was["X"][-1, 0]
    if more:
        now["X"][angle, 0] = plain.bank["angle"][0]
    rich.bank["mixed"][0] = now["theta"][: rich.p]


def _told(rich: Workspace, shape: _Shape) -> None:
    """Tell the law and the prior of a filter which shape it has."""
    tuning, n = rich.tuning[0], rich.p - 1
    tuning["law_value"][-1, WHICH] = shape.which
    tuning["law_memory"][-1] = tuning["load"] if shape.which == SIDES else rich.angle
    for record in (*rich.begin, *rich.states):
        record["theta"][n] = shape.n / rich.design.scale[n]
        if shape.which == SIDES:  # its n is the unit of the load
            record["P"][n] = record["P"][:, n] = 0.0


def share(source: Record, target: Record) -> None:
    """Copy what two records have in common: fields of the same shape."""
    for name in target.dtype.names or ():
        if name in (source.dtype.names or ()) and source[name].shape == target[name].shape:
            target[name] = source[name]
