"""
A model over a sample, with derivatives by θ and by the state, eq. (17)–(24): the discretisation.

A model is the block matrix N = [A B; 0 0] T/s and the output row C, each entry a sum of terms
c Πθ^e, in tables. The powers of N are formed once a sample; they hold the transition, and what a
change of an entry of N does to it as well:

    Φ(θ) = Σ_k N^k/k!                                            [x; u] to the next one, (20)
    ∂Φ/∂N_rc ξ = Σ_j N^j e_r g_jc,  g_j = Σ_k (N^k ξ)/(j+k+1)!   the series' derivative by an entry
    z_i⁺ = Φ z_i + Σ_rc ∂N_rc/∂θ_i (∂Φ/∂N_rc ξ)                  sensitivities, (21)–(23)
    ψ_i = C z_i + ∂C/∂θ_i x⁺                                     gradient, (16), (24)

A row of X (n+1, lanes) is a state, in the last row the output, with its derivatives: by each θ, and
where a filter asks for them by the state at the start of the sample. Behind the states are the
torques of laws, which the linear part takes as held.
`flexaxis.estimators.models.discretisation` has the same by a matrix exponential.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.acting import LAW
from flexaxis.estimators.models.compiler import embedded, fused, inlined
from flexaxis.estimators.models.memory import cube, items, matrix, records
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.reaction import assign, couple, drives, law_records, react
from flexaxis.estimators.models.rows import (
    FOUR,
    ONE,
    THREE,
    TWO,
    ZERO,
    add,
    clear,
    copy,
    padded,
    product,
)  # fmt: skip

SIZES = np.dtype(
    [(name, int) for name in ("n", "held", "order", "parts", "steps", "output")] + [("h", float)]
)
"""States, those that are not torques of laws, order of the series, its parts in a step, steps of a
sample, first entry of C, length of a step [s]."""
ENTRY = np.dtype([("row", int), ("column", int), ("first", int), ("last", int), ("value", float)])
"""An entry of [A B; C 0], by columns and those of C last: place, its slopes, and its value at θ."""
SLOPE = np.dtype([("entry", int), ("lane", int), ("value", float)])
"""The derivative of an entry by a θ."""
TERM = np.dtype([("entry", int), ("first", int), ("last", int), ("coefficient", float)])
"""c Πθ^e of an entry: which of the factors are its own."""
FACTOR = np.dtype([("theta", int), ("power", int), ("slope", int)])
"""θ_i^e of a term, and the slope that it adds to."""

INVERSE_FACTORIALS = 1.0 / np.cumprod(np.arange(1.0, 82.0))
SERIES = INVERSE_FACTORIALS[np.add.outer(np.arange(40), np.arange(40))]  # 1/(j+k+1)!
EXPONENTIAL = np.append(1.0, INVERSE_FACTORIALS)[:, None]  # 1/k!


class Axis(NamedTuple):
    """
    A model as it goes over samples.

    Attributes
    ----------
    sizes, entries, slopes, terms, factors, reset
        Its tables; `reset` are the states that are zero when a sample begins.
    Q : ((order+2)(n+1), w) array
        Columns of N⁰, N¹, …, and of Φ.
    point : (n+1, 1) array
        ξ = [x; u].
    trail, g, effect : (order, w), (order, w), (entries, w) arrays
        N^k ξ, g_j, and ∂Φ/∂N_rc ξ of each entry.
    after : (n, lanes) array
        States and derivatives after a part.
    laws : (L,) records
        As of `flexaxis.estimators.models.acting.LAW`.
    drive, square, lanes, response
        What laws need besides, see there.
    """

    sizes: NDArray[np.void]
    entries: NDArray[np.void]
    slopes: NDArray[np.void]
    terms: NDArray[np.void]
    factors: NDArray[np.void]
    reset: NDArray[np.int64]
    Q: NDArray[np.float64]
    point: NDArray[np.float64]
    trail: NDArray[np.float64]
    g: NDArray[np.float64]
    effect: NDArray[np.float64]
    after: NDArray[np.float64]
    laws: NDArray[np.void]
    drive: NDArray[np.float64]
    square: NDArray[np.float64]
    lanes: NDArray[np.float64]
    response: NDArray[np.float64]


FIELDS = len(Axis._fields)


@embedded
def axis_in(block, at):
    """Return the model of a block, whose arrays come in the order of `Axis`."""
    return Axis(
        records(block, at[0], 7)[0].view(SIZES),
        records(block, at[1], 5)[0].view(ENTRY),
        records(block, at[2], 3)[0].view(SLOPE),
        records(block, at[3], 4)[0].view(TERM),
        records(block, at[4], 3)[0].view(FACTOR),
        items(block, at[5])[0].view(np.int64),
        matrix(block, at[6])[0],
        matrix(block, at[7])[0],
        matrix(block, at[8])[0],
        matrix(block, at[9])[0],
        matrix(block, at[10])[0],
        matrix(block, at[11])[0],
        records(block, at[12], LAW_WORDS)[0].view(LAW),
        matrix(block, at[13])[0],
        cube(block, at[14])[0],
        cube(block, at[15])[0],
        cube(block, at[16])[0],
    )


LAW_WORDS = LAW.itemsize // 8


def axis_arrays(
    model: Parametrization, plan: tuple[int, int, int], period: float, lanes: int
) -> dict[str, NDArray]:
    """
    Return the arrays of an `Axis`, by name.

    Parameters
    ----------
    model : Parametrization
    plan : (steps, order, parts)
        Steps of a sample, order of the series, and its parts in a step.
    period : float
        Of a sample [s].
    lanes : int
        Length of a row of X.
    """
    steps, order, parts = plan
    n, held, L = model.n, model.states, model.forces
    columns, w = n + 1, padded(held)
    scale = np.where(model.row < n, period / steps / parts, 1.0)  # the output is read, not run
    entries, tables = _tables(model, model.coefficient * scale)
    Q = np.zeros(((order + 2) * columns, w))
    Q[np.arange(held), np.arange(held)] = 1.0  # N⁰
    sizes = np.zeros(1, SIZES)
    sizes[0] = n, held, order, parts, steps, np.sum(entries["row"] < n), period / steps
    return dict(
        sizes=sizes,
        entries=entries,
        **tables,
        reset=np.array(model.reset, np.int64),
        Q=Q,
        point=np.zeros((columns, 1)),
        trail=np.zeros((order, w)),
        g=np.zeros((order, w)),
        effect=np.zeros((len(entries), w)),
        after=np.zeros((n, lanes)),
        **law_records(model.laws, lanes),
        response=np.zeros((L, columns, lanes)),
    )


def _tables(model: Parametrization, coefficient: NDArray) -> tuple[NDArray, dict[str, NDArray]]:
    """Return the entries of a model, and its slopes, terms and factors."""
    keys = np.column_stack([model.row, model.column, model.exponent])
    keys, inverse = np.unique(keys, axis=0, return_inverse=True)
    coefficient = np.bincount(inverse.ravel(), coefficient).astype(float)
    places = np.unique(keys[:, :2], axis=0)
    places = places[np.lexsort((places[:, 0], places[:, 1], places[:, 0] == model.n))]
    index = {(r, c): e for e, (r, c) in enumerate(places.tolist())}
    powers_of = [(index[r, c], powers) for r, c, *powers in keys.tolist()]
    varying = {e for e, powers in powers_of if any(powers)}
    pairs = sorted({(e, i) for e, powers in powers_of for i, power in enumerate(powers) if power})
    entries, slopes = np.zeros(len(places), ENTRY), np.zeros(len(pairs), SLOPE)
    entries["row"], entries["column"] = places.T
    slopes["entry"], slopes["lane"] = np.array(pairs, int).reshape(-1, 2).T
    slopes["lane"] += 1
    entries["first"] = np.searchsorted(slopes["entry"], np.arange(len(places)), "left")
    entries["last"] = np.searchsorted(slopes["entry"], np.arange(len(places)), "right")
    terms, factors = list[tuple](), list[tuple]()
    for (e, powers), c in zip(powers_of, coefficient.tolist(), strict=True):
        if e not in varying:
            entries["value"][e] += c
            continue
        own = [(i, power, pairs.index((e, i))) for i, power in enumerate(powers) if power]
        terms.append((e, len(factors), len(factors) + len(own), c))
        factors += own
    return entries, {
        "slopes": slopes,
        "terms": np.array(terms, TERM),
        "factors": np.array(factors, FACTOR),
    }


@fused
def evaluate(entries, slopes, terms, factors, theta):
    """Write the entries that depend on θ, and their slopes, eq. (17)–(19)."""
    for k in range(len(terms)):
        entries[terms[k]["entry"]]["value"] = 0.0
    for s in range(len(slopes)):
        slopes[s]["value"] = 0.0
    for k in range(len(terms)):
        first, last = terms[k]["first"], terms[k]["last"]
        value = terms[k]["coefficient"]
        for f in range(first, last):
            x, e = theta[factors[f]["theta"]], factors[f]["power"]
            if e < 0:
                x, e = 1.0 / x, -e
            for _ in range(e):
                value *= x
        entries[terms[k]["entry"]]["value"] += value
        for f in range(first, last):
            slope = value * factors[f]["power"] / theta[factors[f]["theta"]]
            slopes[factors[f]["slope"]]["value"] += slope


@fused
def powers(entries, output, order, Q):
    """Write N^k and, behind them, Φ = Σ N^k/k!, eq. (20), by columns."""
    columns = len(Q) // (order + 2)
    last = 0  # N⁰ is there already
    for _ in range(order):
        now, e = last + columns, 0
        for j in range(columns):
            first = e
            while e < output and entries[e]["column"] == j:
                e += 1
            _column(Q, now + j, entries, first, e, last)
        last = now
    for j in range(columns):
        product(Q, last + columns + j, EXPONENTIAL, 0, 0, Q, j, columns, order + 1)


@fused
def _column(Q, to, entries, first, last, at):  # noqa: PLR0917
    """Write a column of N^k: those of N^(k−1) that each entry of the column of N reads."""
    to, at = np.uint64(to), np.uint64(at)
    for b in range(ZERO, np.uint64(Q.shape[1]), FOUR):
        p = q = r = s = 0.0
        for e in range(first, last):
            m, of = entries[e]["value"], at + np.uint64(entries[e]["row"])
            p += m * Q[of, b]
            q += m * Q[of, b + ONE]
            r += m * Q[of, b + TWO]
            s += m * Q[of, b + THREE]
        Q[to, b], Q[to, b + ONE], Q[to, b + TWO], Q[to, b + THREE] = p, q, r, s


@fused
def effects(entries, output, held, order, Q, xi, trail, g, effect):  # noqa: PLR0917
    """Write what one more in each entry that varies does to Φ ξ."""
    columns = len(Q) // (order + 2)
    for i in range(held):
        trail[0, i] = xi[i, 0]
    for k in range(1, order):
        product(trail, k, xi, 0, 0, Q, k * columns, 1, columns)
    for j in range(order):
        product(g, j, SERIES, 0, j, trail, 0, 1, order - j)
    for e in range(output):
        if entries[e]["first"] < entries[e]["last"]:
            r, c = entries[e]["row"], entries[e]["column"]
            if c < held:
                product(effect, e, g, 0, c, Q, r, columns, order)
            elif xi[c, 0] != 0.0:  # input, and torques of laws, which are held
                product(effect, e, SERIES, 0, 0, Q, r, columns, order)
                add(effect, e, xi[c, 0] - 1.0, effect, e)
            else:
                clear(effect, e)


@fused
def advance(entries, slopes, output, Q, phi, held, xi, effect, moved, X):  # noqa: PLR0917
    """Take X over a part of a sample: x⁺ = Φ [x; u], z⁺ = Φ z + what θ changes of Φ [x; u]."""
    for i in range(held):
        product(moved, i, Q, phi, i, X, 0, 1, held)
        for j in range(held, len(xi)):  # input, and torques of laws, which are held
            moved[i, 0] += Q[phi + j, i] * xi[j, 0]
    for s in range(len(slopes)):
        e, lane, m = slopes[s]["entry"], slopes[s]["lane"], slopes[s]["value"]
        if e < output:
            for i in range(held):
                moved[i, lane] += m * effect[e, i]
    for i in range(held):
        copy(X, i, moved, i)


@fused
def read(entries, slopes, output, X):
    """Write the output and its derivatives, eq. (16), into the last row of X."""
    n = len(X) - 1
    clear(X, n)
    for e in range(output, len(entries)):
        add(X, n, entries[e]["value"], X, entries[e]["column"])
        for s in range(entries[e]["first"], entries[e]["last"]):
            X[n, slopes[s]["lane"]] += slopes[s]["value"] * X[entries[e]["column"], 0]


@inlined
def _part(axis, u, law, X):
    """Take X over a part, with the torque u held, and that of one law, or of none (−1), as one."""
    entries, Q, xi, effect, sizes = axis.entries, axis.Q, axis.point, axis.effect, axis.sizes[0]
    n, held, order, output = sizes["n"], sizes["held"], sizes["order"], sizes["output"]
    for i in range(n):
        xi[i, 0] = X[i, 0] if i < held else 0.0
    xi[n, 0] = u
    if law >= 0:
        xi[held + law, 0] = 1.0
    effects(entries, output, held, order, Q, xi, axis.trail, axis.g, effect)
    phi = (order + 1) * (n + 1)
    advance(entries, axis.slopes, output, Q, phi, held, xi, effect, axis.after, X)


LAWS = 1
"""What `over_sample` is told of a model with laws; of one without, None: that leaves out of a
compiled loop what laws need."""


@inlined
def over_sample(axis, theta, X, u, laws):
    """Take X over a sample at θ with u held, eq. (17)–(23)."""
    if laws is None:
        linear_sample(axis, theta, X, u)
    else:
        lawful_sample(axis, theta, X, u)


@inlined
def linear_sample(axis, theta, X, u):
    """Do so where there are no laws."""
    entries, sizes = axis.entries, axis.sizes[0]
    evaluate(entries, axis.slopes, axis.terms, axis.factors, theta)
    powers(entries, sizes["output"], sizes["order"], axis.Q)
    for i in axis.reset:
        clear(X, i)
    for _ in range(sizes["parts"]):
        _part(axis, u, -1, X)
    read(entries, axis.slopes, sizes["output"], X)


@inlined
def lawful_sample(axis, theta, X, u):
    """Do so where after each step of the sample laws react."""
    entries, slopes, laws, response = axis.entries, axis.slopes, axis.laws, axis.response
    sizes, drive = axis.sizes[0], axis.drive
    output, parts = sizes["output"], sizes["parts"]
    evaluate(entries, slopes, axis.terms, axis.factors, theta)
    powers(entries, output, sizes["order"], axis.Q)
    assign(laws, theta)
    for law in range(len(laws)):
        for i in range(len(X)):
            clear(response[law], i)
        for _ in range(parts):
            _part(axis, 0.0, law, response[law])
        read(entries, slopes, output, response[law])
    couple(drive, response, axis.square[0])
    for i in axis.reset:
        clear(X, i)
    for _ in range(sizes["steps"]):
        drives(drive, X, u, axis.lanes[0])
        for _ in range(parts):
            _part(axis, u, -1, X)
        read(entries, slopes, output, X)
        react(laws, drive, axis.square, axis.lanes, sizes["h"], response, u, X)
