"""
A model over a sample as straight-line source, written from its pattern and compiled by numba.

A quantity and its derivatives, [a, ∂a/∂θ_1, …, ∂a/∂θ_p], are the lanes of a row, and go through a
model by the product rule, eq. (17)–(23). Only places where the matrices are not zero are written,
and only derivatives that an entry has. `flexaxis.estimators.models.sampled` is the same at fixed
parameters, by a matrix exponential.
"""

from collections import defaultdict
from collections.abc import Collection, Sequence

from flexaxis.estimators.models.compiler import Compiled, remembered
from flexaxis.estimators.models.discretisation import Pattern

TOGETHER = 12  # lanes that go at once; what has more goes in parts, or compiles for ever
PART = 4  # lanes in a part
HEAD = "def {}(M, X, {}, weights, order, substeps):"


@remembered
def evaluate(pattern: Pattern) -> Compiled:
    """
    Return ``evaluate(coefficients, theta, M)``, `inlined`: write the entries that depend on θ.

    Parameters
    ----------
    pattern : Pattern

    Returns
    -------
    callable
        ``coefficients`` (terms,), ``theta`` (p,), without zeros, and ``M`` (entries, lanes), each
        entry of [A B; C 0] with its derivatives; those that are always zero are left alone.
    """
    lines = ["def evaluate(coefficients, theta, M):"]
    lines += [f" p{i} = theta[{i}]; q{i} = 1.0 / p{i}" for i in range(pattern.p)]
    lines += [f" M[{e}, {a}] = {' + '.join(sum_)}" for (e, a), sum_ in _entries(pattern).items()]
    return Compiled("\n".join([*lines, " return"]), inline=True)


@remembered
def place(pattern: Pattern) -> Compiled:
    """
    Return ``place(coefficients, theta, M)``, `inlined`: as `evaluate`, each lane at its own θ.

    Parameters
    ----------
    pattern : Pattern

    Returns
    -------
    callable
        ``theta`` is (p, lanes); ``M`` has no derivatives.
    """
    lines = ["def place(coefficients, theta, M):", " for a in range(M.shape[1]):"]
    lines += [f"  p{i} = theta[{i}, a]; q{i} = 1.0 / p{i}" for i in range(pattern.p)]
    lines += [f"  M[{e}, a] = {' + '.join(v)}" for (e, a), v in _entries(pattern).items() if not a]
    return Compiled("\n".join([*lines, " return"]), inline=True)


def _entries(pattern: Pattern) -> dict[tuple[int, int], list[str]]:
    """Return the terms of each entry (e, 0), and of its derivatives (e, a) that are not zero."""
    found: dict[tuple[int, int], list[str]] = defaultdict(list)
    for k, (entry, *exponents) in enumerate(pattern.terms):
        found[entry, 0].append(_monomial(f"coefficients[{k}]", exponents))
        for i, e in enumerate(exponents):
            if e:
                lowered = [f - (i == j) for j, f in enumerate(exponents)]
                slope = _monomial(f"coefficients[{k}] * {float(e)}", lowered)
                found[entry, 1 + i].append(slope)
    return found


def _monomial(c: str, exponents: Sequence[int]) -> str:
    powers = [[f"{'p' if e > 0 else 'q'}{i}"] * abs(e) for i, e in enumerate(exponents)]
    return " * ".join([c, *(each for some in powers for each in some)])


@remembered
def advance(pattern: Pattern) -> Compiled:
    """
    Return ``advance(M, X, u, weights, order, substeps)``, `inlined`: X over a sample.

    The series Σ (A T/s)^k/k! acts on the lanes of X (n+1, lanes), x and its derivatives, so that no
    matrix exponential is formed, eq. (20)–(23); the last row, the output, is written only. The held
    input is one more state that never changes; its powers vanish after the first.

    Parameters
    ----------
    pattern : Pattern
    """
    some = 1 + pattern.p <= TOGETHER
    return Compiled("\n".join((_at_once if some else _in_parts)(pattern)), inline=True, fused=True)


def _at_once(pattern: Pattern) -> list[str]:
    sloped = [(entry, a) for entry, a in _entries(pattern) if a]
    lanes = _Lanes(pattern, [str(a) for a in range(1 + pattern.p)], sloped)
    held = ["h = u", *(f"h{a} = {'0.0' if a else 'u'}" for a in range(1 + pattern.p))]
    return [
        HEAD.format("advance", "u"),
        *_shifted(1, lanes.begin(pattern.reset)),
        " for _ in range(substeps):",
        *_shifted(2, held + lanes.series()),
        *_shifted(1, lanes.end() + lanes.output()),
    ]


def _in_parts(pattern: Pattern) -> list[str]:
    """Return the same for many lanes: the values first, then a part after the other along them."""
    sloped = {entry for entry, a in _entries(pattern) if a}
    values = _Lanes(pattern, ["0"])
    part = _Lanes(
        pattern,
        [f"b + {j}" for j in range(PART)],
        [(entry, j) for entry in sloped for j in range(PART)],
        value="values[k, {}]",
        moves="moves",
    )
    keep = [f"values[k, {i}] = v{i}_0" for i in range(pattern.n)]
    held = ["h = u", "h0 = u * (1.0 - moves)", *(f"h{j} = 0.0" for j in range(1, PART))]
    output = " + ".join(
        f"M[{k}, 0] * X[{column}, a]" + f" + M[{k}, a] * slope * X[{column}, 0]" * (k in sloped)
        for k, (row, column, _) in enumerate(pattern.entries)
        if row == pattern.n
    )
    return [
        HEAD.format("advance", "u"),
        f" values = np.empty((order, {pattern.n}))",
        *(f" X[{i}, :] = 0.0" for i in pattern.reset),
        " for _ in range(substeps):",
        *_shifted(2, [*values.begin(), "h0 = u", *values.series(keep)]),
        f"  for b in range(0, X.shape[1], {PART}):",
        "   moves = 1.0 if b else 0.0",
        *_shifted(3, [*part.begin(), *held, *part.series(), *part.end()]),
        " for a in range(X.shape[1]):",
        "  slope = 1.0 if a else 0.0",
        f"  X[{pattern.n}, a] = {output}",
    ]


class _Lanes:
    """
    Lines of source that take some lanes of X through the series.

    Parameters
    ----------
    pattern : Pattern
    lanes : sequence of str
        Where in a row each is.
    sloped : collection of (entry, place in lanes)
        Derivatives that entries have; of a value, see `moves`, they are zero.
    value : str
        Where the value of a state's k-th power is.
    moves : str
        What is 0 where the first lane is the value, 1 where it is a derivative; "" if it has none.
    """

    def __init__(
        self,
        pattern: Pattern,
        lanes: Sequence[str],
        sloped: Collection[tuple[int, int]] = (),
        *,
        value: str = "v{}_0",
        moves: str = "",
    ) -> None:
        self.pattern, self.lanes, self.sloped = pattern, lanes, sloped
        self.value, self.moves = value, moves
        self.places = [(i, j) for i in range(pattern.n) for j in range(len(lanes))]

    def begin(self, reset: Sequence[int] = ()) -> list[str]:
        """Read states and entries."""
        lines = [f"x{i}_{j} = {0.0 if i in reset else f'X[{i}, {self.lanes[j]}]'}"
                 for i, j in self.places]  # fmt: skip
        lines += [f"m{k} = M[{k}, 0]" for k in range(len(self.pattern.entries))]
        # By a factor, as numba takes far longer to compile a branch for each entry.
        moves = [f" * {self.moves}" * (not j and bool(self.moves)) for j in range(len(self.lanes))]
        lines += [f"s{k}_{j} = M[{k}, {self.lanes[j]}]{moves[j]}" for k, j in self.sloped]
        return lines

    def series(self, keep: Sequence[str] = ()) -> list[str]:
        """Add a substep to the states; the held input is one more, and vanishes after a term."""
        body = ["w = weights[k]", *keep]
        body += [f"t{i}_{j} = {self._product(i, j, 'v')}" for i, j in self.places]
        body += [f"x{i}_{j} += w * t{i}_{j}; v{i}_{j} = t{i}_{j}" for i, j in self.places]
        body += [f"h{j} = 0.0" for j in range(len(self.lanes))]
        body += ["h = 0.0"] * bool(self.sloped)
        start = [f"v{i}_{j} = x{i}_{j}" for i, j in self.places]
        return [*start, "for k in range(order):", *_shifted(1, body)]

    def end(self) -> list[str]:
        """Write the states."""
        return [f"X[{i}, {self.lanes[j]}] = x{i}_{j}" for i, j in self.places]

    def output(self) -> list[str]:
        """Write the output."""
        n = self.pattern.n
        return [f"X[{n}, {lane}] = {self._product(n, j, 'x')}"
                for j, lane in enumerate(self.lanes)]  # fmt: skip

    def _product(self, row: int, j: int, state: str) -> str:
        """Return lane j of a row of [A B; C 0] times the states."""
        products = []
        for k, (i, column, _) in enumerate(self.pattern.entries):
            if i != row:
                continue
            held = column == self.pattern.n
            products.append(f"m{k} * " + (f"h{j}" if held else f"{state}{column}_{j}"))
            if (k, j) in self.sloped:
                value = f"x{column}_0" if state == "x" else self.value.format(column)
                products.append(f"s{k}_{j} * " + ("h" if held else value))
        return " + ".join(products) or "0.0"


def _shifted(by: int, lines: Sequence[str]) -> list[str]:
    return [" " * by + line for line in lines]
