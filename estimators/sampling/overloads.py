"""What numba makes of `sampling.lanes`: straight-line code for the pattern of a model."""

from collections import defaultdict
from functools import reduce

from numba import types
from numba.core.cgutils import for_range, for_range_slice
from numba.extending import intrinsic, overload

from flexaxis.estimators.sampling.emit import DOUBLE, INDEX, Lanes
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import unflatten


@intrinsic(prefer_literal=True)
def _evaluate(typing_context, flat, coefficients, theta, M):
    pattern = unflatten(tuple(number.literal_value for number in flat))

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, pattern.lanes)
        coefficients, theta, M = map(lanes.data, signature.args[1:], arguments[1:])
        values = [lanes.scalar(theta, INDEX(i)) for i in range(pattern.p)]
        inverses = [builder.fdiv(DOUBLE(1.0), value) for value in values]

        def monomial(c, exponents):
            for value, inverse, e in zip(values, inverses, exponents, strict=True):
                for _ in range(abs(e)):
                    c = builder.fmul(c, value if e > 0 else inverse)
            return c

        summands = defaultdict(list)
        for k, (entry, *exponents) in enumerate(pattern.terms):
            c = lanes.scalar(coefficients, INDEX(k))
            summands[entry, 0].append(monomial(c, exponents))
            for i, e in enumerate(exponents):
                if e:
                    lowered = [f - (i == j) for j, f in enumerate(exponents)]
                    slope = monomial(builder.fmul(c, DOUBLE(e)), lowered)
                    summands[entry, 1 + i].append(slope)
        rows = {entry: lanes.zero for entry, *_ in pattern.terms}
        for (entry, lane), parts in summands.items():
            rows[entry] = lanes.insert(rows[entry], reduce(builder.fadd, parts), lane)
        for entry, row in rows.items():
            lanes.store(row, M, entry)
        return context.get_dummy_value()

    return types.void(flat, coefficients, theta, M), emit


@intrinsic(prefer_literal=True)
def _advance(typing_context, flat, M, X, u, weights, order, substeps):  # noqa: PLR0917
    pattern = unflatten(tuple(number.literal_value for number in flat))
    n = pattern.n

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, pattern.lanes)
        M, X, weights = (lanes.data(signature.args[i], arguments[i]) for i in (1, 2, 4))
        u, order, substeps = (arguments[i] for i in (3, 5, 6))
        held = lanes.insert(lanes.zero, u, 0)
        factors = [lanes.load(M, e) for e in range(len(pattern.entries))]
        sloped = _sloped(pattern, lanes)
        x, v = ([lanes.place() for _ in range(n)] for _ in range(2))
        for i in range(n):
            lanes.put(lanes.load(X, i), x[i])

        def product(row, V):
            pairs: list[list] = []
            for k, (i, column, _) in enumerate(pattern.entries):
                if i == row and V[column] is not None:
                    a, b = factors[k], lanes.value(V[column])
                    pairs.append([*zip(lanes.value(a), V[column], strict=True)])
                    if sloped[k]:
                        slopes = zip(lanes.slope(a), b, strict=True)
                        pairs.append([s if c in sloped[k] else None for c, s in enumerate(slopes)])
            return lanes.sum_of_products(pairs)

        def add_term(k, held):
            V = [lanes.get(place) for place in v] + [held]
            weight = lanes.value(lanes.insert(lanes.zero, lanes.scalar(weights, k), 0))
            for i in range(n):
                power = product(i, V)
                lanes.put(power, v[i])
                lanes.put(lanes.fused(weight, power, lanes.get(x[i])), x[i])

        for i in pattern.reset:
            lanes.put(lanes.zero, x[i])
        with for_range(builder, substeps):
            for i in range(n):
                lanes.put(lanes.get(x[i]), v[i])
            add_term(INDEX(0), held)
            with for_range_slice(builder, INDEX(1), order, INDEX(1)) as (k, _):
                add_term(k, None)
        state = [lanes.get(place) for place in x]
        for i, vector in enumerate([*state, product(n, [*state, None])]):
            lanes.store(vector, X, i)
        return context.get_dummy_value()

    return types.void(flat, M, X, u, weights, order, substeps), emit


def _sloped(pattern, lanes):
    """Return the parts of the row of each entry in which it has derivatives."""
    sloped: list[set[int]] = [set() for _ in pattern.entries]
    for entry, *exponents in pattern.terms:
        sloped[entry] |= {(1 + i) // lanes.part for i, e in enumerate(exponents) if e}
    return sloped


@overload(evaluate, prefer_literal=True)
def _compiled_evaluate(flat, coefficients, theta, M):
    def compiled(flat, coefficients, theta, M):
        _evaluate(flat, coefficients, theta, M)  # type: ignore[call-arg]

    return compiled


@overload(advance, prefer_literal=True)
def _compiled_advance(flat, M, X, u, weights, order, substeps):  # noqa: PLR0917
    def compiled(flat, M, X, u, weights, order, substeps):  # noqa: PLR0917
        _advance(flat, M, X, u, weights, order, substeps)  # type: ignore[call-arg]

    return compiled
