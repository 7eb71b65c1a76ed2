"""
Coulomb friction along a record, exactly: reversals are met when they happen, not after a step.

Between its events an axis with Coulomb friction is linear: it slides, and friction is a constant
torque, or it sticks, and the speed is zero. The instants at which a speed reaches zero, or at which
a torque breaks away, are roots of the Taylor polynomial of the solution. There derivatives jump by
(f⁻ − f⁺) τ', with f the derivative of the state before and after, and τ' that of the instant
(M. A. Aizerman and F. R. Gantmakher, *On the stability of periodic motions*, 1958). So estimates
have no steps to depend on, and the sum of squares is smooth in them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.law_torques import BRISTLE
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]

COULOMB, BREAKAWAY, STIFFNESS, DAMPING, SOFTNESS = 0, 1, 3, 4, 5  # roles of bristles
STIFF = 1.0  # radians a sample: bristles that swing faster are Coulomb's friction
MOST_EVENTS = 40  # in a part of a sample
GRID = np.r_[1e-6, 1e-4, 1e-2, np.linspace(0.1, 1.0, 10)]  # of a part, where events are looked for


class _Dry(NamedTuple):
    """
    An axis with Coulomb friction at fixed parameters, as `follow` takes it.

    Attributes
    ----------
    row, column : (entries,) int arrays
        Places of the generator that are not zero.
    slides, sticks : (entries, 1+p) arrays
        The generator and its derivatives, and those of the axis that sticks.
    sliding, sticking : (1+p, n+1, n+1) arrays
        What a sample makes of a state; outputs come last.
    output : (1+p, n+1) array
        y, of the state.
    pull : (n+1,) array
        Derivative of the speed, of the state.
    speed, torque : int
        Places of the speed and of the torque of friction.
    sense : float
        Sign of that torque when the speed is positive.
    level : float
        f_c.
    lane : int
        Whose derivative is by f_c; 0 for none.
    gain : float
        Derivative of f_c by its parameter.
    cleared : (r,) int array
        States that are zero at the start of every sample.
    parts, order : int
        Of a sample, and of the series in each.
    h : float
        Length of a part [s].
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    slides: Array
    sticks: Array
    sliding: Array
    sticking: Array
    output: Array
    pull: Array
    speed: int
    torque: int
    sense: float
    level: float
    lane: int
    gain: float
    cleared: NDArray[np.int64]
    parts: int
    order: int
    h: float


def is_dry(model: Parametrization, period: float) -> bool:
    """Return whether the only law of an axis is Coulomb friction of one of its speeds.

    Bristles that swing faster than a period [s] can show, as (σ₀/J)^½ rad/s, are that.
    """
    laws = model.laws
    if len(laws.records) != 1 or laws.records["kind"][0] != BRISTLE:
        return False
    force = model.blocks(model.theta)[0, : model.n, model.n - 1]
    value, parameter = laws.records["value"][0], laws.records["parameter"][0]
    shaped = any(value[r] or parameter[r] >= 0 for r in (BREAKAWAY, DAMPING, SOFTNESS))
    if shaped or parameter[STIFFNESS] >= 0 or np.sum(laws.drive[0] != 0) != 1:
        return False
    speed = int(np.argmax(laws.drive[0]))
    alone = np.flatnonzero(force).tolist() == [speed] and laws.drive[0, speed] == 1
    return bool(alone and np.sqrt(value[STIFFNESS] * abs(force[speed])) * period >= STIFF)


def dry(model: Parametrization, theta: Array, period: float) -> _Dry:
    """Return an axis that `is_dry` at some parameters, sampled with a period [s]."""
    n, generator, laws = model.n, model.blocks(theta), model.laws
    speed = int(np.argmax(laws.drive[0]))
    _, order, parts = plan(model, theta, theta, period)
    output, stuck = generator[:, n].copy(), generator.copy()
    stuck[:, speed] = 0.0
    sliding, sticking = _sampled(generator, period), _sampled(stuck, period)
    generator[:, n] = 0.0
    row, column = np.nonzero(np.any(generator != 0, axis=0))
    slides = np.ascontiguousarray(generator[:, row, column].T)
    sticks = np.where((row == speed)[:, None], 0.0, slides)
    which = int(laws.records["parameter"][0, COULOMB])
    factor = float(laws.records["value"][0, COULOMB])
    options = parts, order, period / parts
    sense = -float(np.sign(generator[0, speed, n - 1]))
    level = factor * float(theta[which]) if which >= 0 else factor
    return _Dry(
        row, column, slides, sticks, sliding, sticking, output, generator[0, speed].copy(), speed,
        n - 1, sense, level, 1 + which, factor, np.array(model.reset, np.int64), *options,
    )  # fmt: skip


def _sampled(blocks: Array, period: float) -> Array:
    """
    Return what a sample makes of states and torque, with derivatives, eq. (17)–(23).

    Parameters
    ----------
    blocks : (1+p, n+1, n+1) array
        [A B; C 0] and its derivatives.
    period : float
        Of the sample [s].

    Returns
    -------
    (1+p, n+1, n+1) array
        D[0] takes [x[k]; u[k]] to [x[k+1]; y[k+1]]; D[1+i] is its derivative by θ_i. By C. F. Van
        Loan, *Computing integrals involving the matrix exponential*, IEEE Trans. AC 23 (1978).
    """
    from scipy.linalg import expm  # takes a tenth of a second to import

    n, output = blocks.shape[1] - 1, blocks[:, -1]
    pairs = np.zeros((max(len(blocks) - 1, 1), 2, n + 1, 2, n + 1))
    pairs[:, 0, :n, 0] = pairs[:, 1, :n, 1] = blocks[0, :n] * period
    pairs[: len(blocks) - 1, 0, :n, 1] = blocks[1:, :n] * period
    both = expm(pairs.reshape(len(pairs), 2 * n + 2, -1)).reshape(pairs.shape)
    D = np.concatenate([both[:1, 0, :, 0], both[: len(blocks) - 1, 0, :, 1]])
    D[:, n] = output[0] @ D
    D[1:, n] += output[1:] @ D[0]
    return D


@inlined
def _move(D, X, moved, u):
    """
    Take states and sensitivities [x; y] over one sample; the place of y lends itself to u.

    Rows of X beyond those of D are sensitivities to what acts through the state alone, such as the
    state itself some time ago.
    """
    size = X.shape[1]
    X[0, size - 1] = u
    for a in range(1, len(X)):
        X[a, size - 1] = 0.0
    for i in range(size):
        for a in range(len(X)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j]
            if 0 < a < len(D):
                for j in range(size):
                    total += D[a, i, j] * X[0, j]
            moved[a, i] = total


@compiled
def follow(dry, X, torque, slopes, offset, begin, first):  # noqa: PLR0917
    """
    Return output and derivatives (rows, N) along a record; X is lost.

    Parameters
    ----------
    dry : _Dry
    X : (rows, n+1) array
        State and derivatives at first; those by θ, then others.
    torque : (N,) array
    slopes : (m+1, N) array
        What of the torque rows from ``first`` on are by, and the last one, at the place ``offset``
        of the state.
    offset, begin, first : int
    """
    lanes, size = X.shape
    rows, v = np.zeros((lanes, len(torque))), dry.speed
    moved, term, rest = np.zeros((lanes, size)), np.zeros((lanes, size)), np.zeros((lanes, size))
    series = np.zeros((dry.order + 1, size))
    way = np.sign(X[0, v])
    for k in range(begin, len(torque) - 1):
        for i in dry.cleared:
            X[:, i] = 0.0
        for j in range(len(slopes) - 1):
            X[first + j, offset] = slopes[j, k]
        X[-1, offset] = slopes[-1, k]
        _push(dry, X, way)
        if way == 0.0:
            _move(dry.sticking, X, moved, torque[k])
            met = _breaks(dry, X) or _breaks_late(dry, moved, torque[k])
        else:
            _move(dry.sliding, X, moved, torque[k])
            met = _turns(dry, X, moved, torque[k], way)
        if met:
            for _ in range(dry.parts):
                way = _part(dry, X, way, series, term, rest)
            _read(dry.output, X)
        else:
            X[:] = moved
        for a in range(lanes):
            rows[a, k + 1] = X[a, size - 1]
    return rows


@inlined
def _push(dry, X, way):
    """Write the torque of friction and its derivatives into a state."""
    for a in range(len(X)):
        X[a, dry.torque] = 0.0
    X[0, dry.torque] = dry.sense * way * dry.level
    if dry.lane > 0:
        X[dry.lane, dry.torque] = dry.sense * way * dry.gain


@inlined
def _pulled(dry, x):
    """Return the derivative of the speed without friction."""
    total = 0.0
    for j in range(len(x)):
        if j != dry.torque:
            total += dry.pull[j] * x[j]
    return total


@inlined
def _breaks(dry, X):
    """Return whether more pulls than friction can hold."""
    return abs(_pulled(dry, X[0])) > abs(dry.pull[dry.torque]) * dry.level


@inlined
def _breaks_late(dry, moved, u):
    """Return whether it does at the end of a sample, where the output is in the place of u."""
    y = moved[0, -1]
    moved[0, -1] = u
    broken = _breaks(dry, moved)
    moved[0, -1] = y
    return broken


@inlined
def _turns(dry, X, moved, u, way):
    """Return whether the speed may reach zero in a sample: at its end, or in between."""
    v, h = dry.speed, dry.h * dry.parts
    if way * moved[0, v] <= 0.0:
        return True
    y = moved[0, -1]
    moved[0, -1] = u
    friction = dry.pull[dry.torque] * X[0, dry.torque]
    first, last = way * (_pulled(dry, X[0]) + friction), way * (_pulled(dry, moved[0]) + friction)
    moved[0, -1] = y
    dips = first < 0.0 < last
    return dips and min(way * X[0, v] + first * h, way * moved[0, v] - last * h) < 0.0


@compiled
def _part(dry, X, way, series, term, rest):  # noqa: PLR0917
    """Take a state over a part of a sample with what happens in it; return which way it slides."""
    left, v = dry.h, dry.speed
    for _ in range(MOST_EVENTS):
        if way == 0.0 and _breaks(dry, X):
            way = np.sign(_pulled(dry, X[0]))
        _push(dry, X, way)
        entries = dry.sticks if way == 0.0 else dry.slides
        _expand(dry, entries, X, left, series)
        share = _first_event(dry, series, way)
        _advance(dry.row, dry.column, entries, X, share * left, dry.order, term, rest)
        left *= 1.0 - share
        if share == 1.0:
            break
        way = np.sign(_pulled(dry, X[0])) if way == 0.0 else _reverse(dry, X, way)
        X[0, v] = 0.0
    return way


@inlined
def _reverse(dry, X, way):
    """Take derivatives over the instant at which the speed is zero; return which way it goes on."""
    v, pull = dry.speed, _pulled(dry, X[0])
    friction = abs(dry.pull[dry.torque]) * dry.level
    before = pull - way * friction
    after, further = 0.0, 0.0
    if abs(pull) > friction:
        further = np.sign(pull)
        after = pull - further * friction
    share = min(max(after / before, 0.0), 1.0) if before != 0.0 else 0.0
    for a in range(1, len(X)):
        X[a, v] *= share
    return further


@inlined
def _expand(dry, entries, X, time, series):
    """Write the Taylor series (order+1, n+1) of a state over a time, which is taken for one."""
    size = X.shape[1]
    for i in range(size):
        series[0, i] = X[0, i]
    for k in range(1, len(series)):
        for i in range(size):
            series[k, i] = 0.0
        for e in range(len(dry.row)):
            series[k, dry.row[e]] += time / k * entries[e, 0] * series[k - 1, dry.column[e]]


@inlined
def _event(dry, series, way, s):
    """Return what is positive until something happens: way·v, or what friction still holds."""
    total, power = 0.0, 1.0
    for k in range(len(series)):
        total += power * (series[k, dry.speed] if way != 0.0 else _pulled(dry, series[k]))
        power *= s
    if way != 0.0:
        return way * total
    return abs(dry.pull[dry.torque]) * dry.level - abs(total)


@inlined
def _first_event(dry, series, way):
    """Return at which share of a time something happens first; 1 if nothing does."""
    low, high = -1.0, -1.0
    for s in GRID:
        if _event(dry, series, way, s) > 0.0:
            low = s
        elif low >= 0.0 or (way != 0.0 and way * series[0, dry.speed] > 0.0):
            high = s
            break
    if high < 0.0:
        return 1.0
    low = max(low, 0.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _event(dry, series, way, middle) > 0.0:
            low = middle
        else:
            high = middle
        if high - low < 1e-14:
            break
    return high if high < 1.0 else 1.0 - 1e-15


@inlined
def _advance(row, column, entries, X, time, order, term, rest):  # noqa: PLR0917
    """Take states and derivatives over a time, by their series."""
    lanes, size = X.shape
    own = entries.shape[1]
    for a in range(lanes):
        for i in range(size):
            term[a, i] = X[a, i]
    for k in range(1, order + 1):
        for a in range(lanes):
            for i in range(size):
                rest[a, i] = 0.0
        for e in range(len(row)):
            i, j, value = row[e], column[e], time / k * entries[e, 0]
            for a in range(lanes):
                rest[a, i] += value * term[a, j]
            for a in range(1, own):
                rest[a, i] += time / k * entries[e, a] * term[0, j]
        for a in range(lanes):
            for i in range(size):
                term[a, i] = rest[a, i]
                X[a, i] += rest[a, i]


@inlined
def _read(output, X):
    """Write outputs and their derivatives into the last place of a state."""
    lanes, size = X.shape
    for a in range(lanes - 1, -1, -1):
        total = 0.0
        for j in range(size - 1):
            total += output[0, j] * X[a, j]
        if 0 < a < len(output):
            for j in range(size - 1):
                total += output[a, j] * X[0, j]
        X[a, size - 1] = total
