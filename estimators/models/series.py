"""
Integration of a model and its derivatives over a sample by equations (17)–(24).

A model is represented by the output row C and the block matrix N = [A B; 0 0] T/s, where T/s is the
length of a substep. The matrices N and C are stored as tables of terms c Πθ^e. The powers of N are
computed once for each sample. The powers of N determine the transition matrix Φ of the vector ξ =
[x; u] and the derivative of Φ with respect to each entry N_rc, where e_r is a unit vector:

    Φ(θ) = Σ_k N^k/k!                                            transition of [x; u], (20)

    ∂Φ/∂N_rc ξ = Σ_j N^j e_r g_jc,  g_j = Σ_k (N^k ξ)/(j+k+1)!   derivative with respect to N_rc

    z_i⁺ = Φ z_i + Σ_rc ∂N_rc/∂θ_i (∂Φ/∂N_rc ξ)                  sensitivities, (21)–(23)

    ψ_i = C z_i + ∂C/∂θ_i x⁺                                     gradient, (16), (24)

Each of the first n rows of X (n+1, lanes) contains a state and its derivatives. The last row of X
contains the output and its derivatives. The derivatives are taken with respect to each θ_i and, in
Kalman filters, with respect to the state at the start of the sample. The last states are the
nonlinear torques, which the linear part of the model treats as constant. The module
`flexaxis.estimators.models.discretisation` computes the state transition with a matrix exponential
instead.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import fused, inlined
from flexaxis.estimators.models.implicit_torque import assign, half_drives, react
from flexaxis.estimators.models.matrix_rows import add, copy, padded, product
from flexaxis.estimators.models.memory import Cube, Indices, Matrix
from flexaxis.estimators.models.parametrization import LAW, Parametrization

SIZES = np.dtype(
    [(name, int) for name in ("n", "held", "order", "parts", "steps", "output")] + [("h", float)]
)
"""
Record type for the dimensions of a model.

The field ``n`` is the number of states including the nonlinear torques, and ``held`` is the number
of states excluding them. The fields ``order``, ``parts`` and ``steps`` are the series order, the
number of substeps per step and the number of steps per sample. The field ``output`` is the index of
the first term of C in the table of terms, and ``h`` is the step length [s].
"""
ENTRY = np.dtype(
    [(name, int) for name in ("row", "column", "first", "last")]
    + [("coefficient", float), ("value", float)]
)
"""
A term c Πθ^e of [A B; C 0], with its row, column, range of slopes, factor c, and value at θ.

The terms are sorted by column, and the terms of C come last.
"""
SLOPE = np.dtype([("entry", int), ("theta", int), ("power", int), ("value", float)])
"""A factor θ_i^e of a term, and the derivative of the term with respect to θ_i."""

INVERSE_FACTORIALS = 1.0 / np.cumprod(np.arange(1.0, 82.0))
SERIES = INVERSE_FACTORIALS[np.add.outer(np.arange(40), np.arange(40))]  # 1/(j+k+1)!
EXPONENTIAL = np.append(1.0, INVERSE_FACTORIALS)[:, None]  # 1/k!


class Axis(NamedTuple):
    """
    A model together with all arrays that are needed to integrate it over a sample.

    Attributes
    ----------
    sizes, entries, slopes, reset : record and int arrays
        Tables of the model. The table ``reset`` contains the indices of the states that are set to
        zero at the start of each sample.
    Q : ((order+2)(n+1), w) array
        Columns of the matrix powers N⁰, N¹, … and of Φ.
    laws : (L,) records
        Nonlinear torque laws as records of type `flexaxis.estimators.models.parametrization.LAW`.
    drive, coupling, work, lanes, response : arrays
        Arrays that `flexaxis.estimators.models.implicit_torque.react` uses.
    point : (n+1, 1) array
        Vector ξ = [x; u].
    trail, g, effect : (order, w), (order, w), (entries, w) arrays
        The vectors N^k ξ, the vectors g_j, and the product ∂Φ/∂N_rc ξ for each term.
    after : (n, lanes) array
        States and their derivatives after a substep.
    """

    sizes: Annotated[NDArray[np.void], SIZES, 1]
    entries: Annotated[NDArray[np.void], ENTRY, 1]
    slopes: Annotated[NDArray[np.void], SLOPE, 1]
    reset: Indices
    Q: Matrix
    laws: Annotated[NDArray[np.void], LAW, 1]
    drive: Matrix
    coupling: Cube
    work: Matrix
    lanes: Cube
    response: Cube
    point: Matrix
    trail: Matrix
    g: Matrix
    effect: Matrix
    after: Matrix


def axis_arrays(
    model: Parametrization, plan: tuple[int, int, int], period: float, lanes: int
) -> dict[str, NDArray]:
    """
    Return the arrays of an `Axis` tuple in a dictionary keyed by array name.

    Parameters
    ----------
    model : Parametrization
    plan : (steps, order, parts)
        Number of steps per sample, order of the series, and number of substeps per step.
    period : float
        Sampling period [s].
    lanes : int
        Number of columns of the array X.
    """
    steps, order, parts = plan
    n, held, L = model.n, model.states, model.forces
    columns, w = n + 1, padded(held)
    entries, slopes = _tables(model, period / steps / parts)
    Q = np.zeros(((order + 2) * columns, w))
    Q[np.arange(held), np.arange(held)] = 1.0  # N⁰
    sizes = np.zeros(1, SIZES)
    sizes[0] = n, held, order, parts, steps, np.sum(entries["row"] < n), period / steps
    shapes = {
        "coupling": (L, L, lanes),
        "work": (L, 2 * L),
        "lanes": (3, L, lanes),
        "response": (L, columns, lanes),
        "point": (columns, 1),
        "trail": (order, w),
        "g": (order, w),
        "effect": (len(entries), w),
        "after": (n, lanes),
    }
    return {
        "sizes": sizes,
        "entries": entries,
        "slopes": slopes,
        "reset": np.array(model.reset, np.int64),
        "Q": Q,
        "laws": model.laws,
        "drive": model.drive,
    } | {name: np.zeros(shape) for name, shape in shapes.items()}


def _tables(model: Parametrization, length: float) -> tuple[NDArray, NDArray]:
    """Return the terms of a model for a substep of ``length`` [s], and the slopes of all terms."""
    scale = np.where(model.row < model.n, length, 1.0)  # the output row C is not integrated
    places = model.row == model.n, model.column, model.row
    keys, which = np.unique(np.column_stack([*places, model.exponent]), axis=0, return_inverse=True)
    exponent = keys[:, 3:]
    entry, theta = np.nonzero(exponent)
    entries, slopes = np.zeros(len(keys), ENTRY), np.zeros(len(entry), SLOPE)
    entries["column"], entries["row"] = keys[:, 1:3].T
    entries["coefficient"] = np.bincount(which.ravel(), model.coefficient * scale)
    entries["value"] = entries["coefficient"]
    entries["first"], entries["last"] = (
        np.searchsorted(entry, np.arange(len(keys)), side) for side in ("left", "right")
    )
    slopes["entry"], slopes["theta"], slopes["power"] = entry, theta, exponent[entry, theta]
    return entries, slopes


@fused
def evaluate(entries, slopes, theta):
    """Update the terms that depend on θ, and their slopes, by equations (17)–(19)."""
    for k in range(len(entries)):
        value, first, last = entries[k]["coefficient"], entries[k]["first"], entries[k]["last"]
        for s in range(first, last):
            value *= theta[slopes[s]["theta"]] ** slopes[s]["power"]
        entries[k]["value"] = value
        for s in range(first, last):
            slopes[s]["value"] = value * slopes[s]["power"] / theta[slopes[s]["theta"]]


@fused
def powers(entries, output, order, Q):
    """Write to Q the columns of all powers N^k and of Φ = Σ N^k/k!, as in equation (20)."""
    columns = len(Q) // (order + 2)
    for last in range(0, order * columns, columns):  # Q contains N⁰ from the start
        now = last + columns
        Q[now : now + columns] = 0.0
        for e in range(output):
            add(Q, now + entries[e]["column"], entries[e]["value"], Q, last + entries[e]["row"])
    for j in range(columns):
        product(Q, len(Q) - columns + j, EXPONENTIAL, 0, 0, Q, j, columns, order + 1)


@fused
def effects(entries, output, held, order, Q, xi, trail, g, effect):  # noqa: PLR0917
    """For each term that depends on θ, write the product ∂Φ/∂N_rc ξ to ``effect``."""
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
            elif xi[c, 0] != 0.0:  # the input and the torques of laws are held constant
                product(effect, e, SERIES, 0, 0, Q, r, columns, order)
                add(effect, e, xi[c, 0] - 1.0, effect, e)
            else:
                effect[e] = 0.0


@fused
def read(entries, slopes, output, X):
    """Write the output and its derivatives to the last row of X, as in equation (16)."""
    n = len(X) - 1
    X[n] = 0.0
    for e in range(output, len(entries)):
        add(X, n, entries[e]["value"], X, entries[e]["column"])
        for s in range(entries[e]["first"], entries[e]["last"]):
            X[n, 1 + slopes[s]["theta"]] += slopes[s]["value"] * X[entries[e]["column"], 0]


@fused
def _part(axis, u, law, X):
    """
    Integrate X over a substep by x⁺ = Φ [x; u] and z_i⁺ = Φ z_i + ∂Φ/∂θ_i [x; u].

    The input u and all nonlinear torques are constant over the substep. The nonlinear torque with
    the index ``law`` is one, and all other nonlinear torques are zero. If ``law`` is −1, all
    nonlinear torques are zero.
    """
    slopes, Q, xi, effect, moved = axis.slopes, axis.Q, axis.point, axis.effect, axis.after
    sizes = axis.sizes[0]
    n, held, order, output = sizes["n"], sizes["held"], sizes["order"], sizes["output"]
    phi = (order + 1) * (n + 1)
    for i in range(n):
        xi[i, 0] = X[i, 0] if i < held else 0.0
    xi[n, 0] = u
    if law >= 0:
        xi[held + law, 0] = 1.0
    effects(axis.entries, output, held, order, Q, xi, axis.trail, axis.g, effect)
    for i in range(held):
        product(moved, i, Q, phi, i, X, 0, 1, held)
        for j in range(held, n + 1):
            moved[i, 0] += Q[phi + j, i] * xi[j, 0]
    for s in range(len(slopes)):
        e, lane, m = slopes[s]["entry"], 1 + slopes[s]["theta"], slopes[s]["value"]
        if e < output:
            for i in range(held):
                moved[i, lane] += m * effect[e, i]
    for i in range(held):
        copy(X, i, moved, i)


LAWS = 1
"""
Value of the loop argument ``laws`` for a model with nonlinear torques.

For a linear model, ``laws`` is None, so the compiled loop contains no code for nonlinear torques.
"""


@inlined
def over_sample(axis, theta, X, u, laws):
    """
    Integrate X over a sample with constant input u by equations (17)–(23).

    The function adds the effects of the nonlinear torques after each integration step.
    """
    entries, slopes, sizes = axis.entries, axis.slopes, axis.sizes[0]
    drive, response, output, parts = axis.drive, axis.response, sizes["output"], sizes["parts"]
    evaluate(entries, slopes, theta)
    powers(entries, output, sizes["order"], axis.Q)
    if laws is not None:
        assign(axis.laws, theta)
        for law in range(len(response)):
            response[law] = 0.0
            for _ in range(parts):
                _part(axis, 0.0, law, response[law])
            read(entries, slopes, output, response[law])
            half_drives(drive, response[law], 0.0, axis.coupling[law])
    for i in axis.reset:
        X[i] = 0.0
    for _ in range(sizes["steps"]):
        if laws is not None:
            half_drives(drive, X, u, axis.lanes[0])
        for _ in range(parts):
            _part(axis, u, -1, X)
        read(entries, slopes, output, X)
        if laws is not None:
            react(axis, sizes["h"], u, X)
