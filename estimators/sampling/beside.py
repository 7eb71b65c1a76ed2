"""
One sample of several runs side by side: entries at θ, then x, sensitivities and output.

What `sampling.overloads` emits for one run, with a number of each run where that has a number: the
same sums and products in the same order, so that a run is to the last bit what it is alone. Of the
derivatives of an entry those that are zero are left out.
"""

from collections import defaultdict
from collections.abc import Sequence
from functools import reduce
from operator import add

from llvmlite import ir
from numba.core.cgutils import for_range, for_range_slice

from flexaxis.estimators.sampling.emit import INDEX
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.plan import MAX_ORDER
from flexaxis.estimators.sampling.runs import Runs, Side, at_a_time

Row = Sequence[Runs | None]  # a value and its derivatives; None for what is known to be zero
Rows = list[list[Runs]]
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


def through(pattern: Pattern, M: Entries, i: int, V: Sequence[Row | None], a: int) -> list:
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


class Series:
    """
    The powers A^k x/k! and their derivatives, some lanes at a time, so that registers suffice.

    Lanes do not hear of each other but for the values, lane 0: they go first, and are kept.

    Parameters
    ----------
    side : Side
    pattern : Pattern
    M : mapping of int to row
        All entries.
    X : (n, 1+p) rows
        Where it begins.
    together : int
        Lanes that go at a time.
    """

    def __init__(self, side: Side, pattern: Pattern, M: Entries, X: Rows, together: int) -> None:
        self.side, self.pattern, self.M = side, pattern, M
        n, lanes = pattern.n, range(1 + pattern.p)
        self.x = [[side.variable() for _ in lanes] for _ in range(n)]
        self.v = [[side.variable() for _ in lanes] for _ in range(n)]
        self.values = side.variable(MAX_ORDER * n)  # of each power
        self.groups = [lanes[a : a + together] for a in lanes[::together]]
        for i in range(n):
            for a in lanes:
                side.write(side.of(0.0) if i in pattern.reset else X[i][a], self.x[i][a])

    def substep(self, u: Runs, weights: ir.Value, order: ir.Value) -> None:
        """Emit one substep, with u held."""
        side, n = self.side, self.pattern.n
        for group in self.groups:
            for i in range(n):
                for a in group:
                    side.write(side.read(self.x[i][a]), self.v[i][a])
            self._term(group, INDEX(0), weights, [u, *[None] * self.pattern.p])
            with for_range_slice(side.builder, INDEX(1), order, INDEX(1)) as (k, _):
                self._term(group, k, weights, None)

    def _term(self, group: range, k: ir.Value, weights: ir.Value, held: Row | None) -> None:
        side, build, n = self.side, self.side.builder, self.pattern.n
        first = build.mul(k, INDEX(n))
        V: list[Row | None] = []
        for i, row in enumerate(self.v):
            place = build.gep(self.values, [build.add(first, INDEX(i))])
            value = side.read(row[0] if 0 in group else place)
            if 0 in group:
                side.write(value, place)
            own = [side.read(row[a]) if a in group else None for a in range(1, len(row))]
            V.append([value, *own])
        weight = side.spread(build.load(build.gep(weights, [k])))
        for i in range(n):
            for a in group:
                power = side.sum_of_products(through(self.pattern, self.M, i, [*V, held], a))
                if power is not None:
                    total = side.fused(weight, power, side.read(self.x[i][a]))
                    side.write(total, self.x[i][a])
                side.write(side.of(0.0) if power is None else power, self.v[i][a])

    def end(self) -> Rows:
        """Return x, sensitivities and output."""
        n = self.pattern.n
        state = [[self.side.read(each) for each in row] for row in self.x]
        output = [
            self.side.sum_of_products(through(self.pattern, self.M, n, [*state, None], a))
            for a in range(1 + self.pattern.p)
        ]
        return [*state, [self.side.of(0.0) if each is None else each for each in output]]


def advance(  # noqa: PLR0917
    side: Side, pattern: Pattern, M: Entries, X: Rows, u: Runs, series: tuple
) -> Rows:
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
    weights, order, substeps = series
    powers = Series(side, pattern, M, X, at_a_time(side.context))
    with for_range(side.builder, substeps):
        powers.substep(u, weights, order)
    return powers.end()
