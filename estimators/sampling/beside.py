"""
One sample of several runs side by side: entries at θ, then x, sensitivities and output.

What `sampling.overloads` emits for one run, with a number of each run where that has a number: the
same sums and products in the same order, so that a run is to the last bit what it is alone. Of the
derivatives of an entry those that are zero are left out.
"""

from collections import defaultdict
from functools import reduce
from operator import add

from llvmlite import ir
from numba.core.cgutils import for_range, for_range_slice

from flexaxis.estimators.sampling.emit import INDEX
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.runs import Runs, Side

Row = list[Runs | None]  # a value and its derivatives; None for what is known to be zero
Entries = dict[int, Row]


def entries(pattern: Pattern, coefficients: list[Runs], theta: list[Runs]) -> Entries:
    """Return the entries that depend on θ, with their derivatives, as `lanes.evaluate` does."""
    inverses = [1.0 / value for value in theta]
    summands: dict[int, dict[int, list[Runs]]] = defaultdict(lambda: defaultdict(list))

    def monomial(c: Runs, exponents: list[int]) -> Runs:
        for value, inverse, e in zip(theta, inverses, exponents, strict=True):
            for _ in range(abs(e)):
                c = c * (value if e > 0 else inverse)
        return c

    for k, (entry, *exponents) in enumerate(pattern.terms):
        summands[entry][0].append(monomial(coefficients[k], exponents))
        for i, e in enumerate(exponents):
            if e:
                lowered = [f - (i == j) for j, f in enumerate(exponents)]
                slope = monomial(coefficients[k] * e, lowered)
                summands[entry][1 + i].append(slope)
    return {
        entry: [reduce(add, lanes[a]) if a in lanes else None for a in range(1 + pattern.p)]
        for entry, lanes in summands.items()
    }


def through(pattern: Pattern, M: Entries, i: int, V: list[Row | None], a: int) -> list:
    """Return the factors whose products are lane a of row i of [A B; C 0] V."""
    pairs = []
    for k, (row, column, _) in enumerate(pattern.entries):
        v = V[column]
        if row != i or v is None:
            continue
        if v[a] is not None:
            pairs.append((M[k][0], v[a]))
        if a and M[k][a] is not None and v[0] is not None:
            pairs.append((M[k][a], v[0]))
    return pairs


def advance(
    side: Side, pattern: Pattern, M: Entries, X: list[list[Runs]], u: Runs, series: tuple
) -> list[list[Runs]]:
    """
    Return x, sensitivities and output after a sample, as `lanes.advance` does.

    Parameters
    ----------
    side : Side
    pattern : Pattern
    M : mapping of int to row
        All entries.
    X : (n, 1+p) rows
    u : Runs
    series : (weights, order, substeps)
        Address of the weights, which all runs share, and the two numbers.
    """
    build, n, (weights, order, substeps) = side.builder, pattern.n, series
    lanes = range(1 + pattern.p)
    x, v = ([[side.variable() for _ in lanes] for _ in range(n)] for _ in range(2))
    zero = side.of(0.0)

    def add_term(k: ir.Value, held: Row | None) -> None:
        V: list[Row | None] = [[side.read(each) for each in row] for row in v]
        weight = side.spread(build.load(build.gep(weights, [k])))
        for i in range(n):
            for a in lanes:
                power = side.sum_of_products(through(pattern, M, i, [*V, held], a))
                if power is not None:
                    total = side.fused(weight, power, side.read(x[i][a]))
                    side.write(total, x[i][a])
                side.write(zero if power is None else power, v[i][a])

    for i in range(n):
        for a in lanes:
            side.write(zero if i in pattern.reset else X[i][a], x[i][a])
    with for_range(build, substeps):
        for i in range(n):
            for a in lanes:
                side.write(side.read(x[i][a]), v[i][a])
        add_term(INDEX(0), [u, *[None] * pattern.p])
        with for_range_slice(build, INDEX(1), order, INDEX(1)) as (k, _):
            add_term(k, None)
    state: list[Row | None] = [[side.read(each) for each in row] for row in x]
    output = [side.sum_of_products(through(pattern, M, n, [*state, None], a)) for a in lanes]
    rows = [[side.read(each) for each in row] for row in x]
    return [*rows, [zero if each is None else each for each in output]]
