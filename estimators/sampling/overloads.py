"""What numba makes of `sampling.lanes` and `points`, straight-line code, and of `prepared`."""

from collections import defaultdict
from functools import reduce

from llvmlite import ir
from numba import types
from numba.core.cgutils import for_range, for_range_slice
from numba.extending import intrinsic, overload

from flexaxis.estimators.sampling.emit import DOUBLE, INDEX, Lanes
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import unflatten
from flexaxis.estimators.sampling.points import convey, place
from flexaxis.estimators.sampling.prepared import laws_ready, ready


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

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, pattern.lanes)
        M, X, weights = (lanes.data(signature.args[i], arguments[i]) for i in (1, 2, 4))
        u, order, substeps = (arguments[i] for i in (3, 5, 6))
        held = lanes.insert(lanes.zero, u, 0)
        factors = [lanes.load(M, e) for e in range(len(pattern.entries))]
        sloped = _sloped(pattern, lanes)

        def pairs(k, row):
            a, b = factors[k], lanes.value(row)
            yield [*zip(lanes.value(a), row, strict=True)]
            if sloped[k]:
                slopes = zip(lanes.slope(a), b, strict=True)
                yield [s if c in sloped[k] else None for c, s in enumerate(slopes)]

        _series(lanes, pattern, pairs, X, held, (weights, order, substeps))
        return context.get_dummy_value()

    return types.void(flat, M, X, u, weights, order, substeps), emit


def _sloped(pattern, lanes):
    """Return the parts of the row of each entry in which it has derivatives."""
    sloped: list[set[int]] = [set() for _ in pattern.entries]
    for entry, *exponents in pattern.terms:
        sloped[entry] |= {(1 + i) // lanes.part for i, e in enumerate(exponents) if e}
    return sloped


def _series(lanes, pattern, pairs, X, held, series):  # noqa: PLR0917
    """Take rows over a sample; ``pairs(k, row)`` are the factors of what entry k makes of a row."""
    builder, n, (weights, order, substeps) = lanes.builder, pattern.n, series
    x, v = ([lanes.place() for _ in range(n)] for _ in range(2))
    for i in range(n):
        lanes.put(lanes.load(X, i), x[i])

    def product(row, V):
        factors = []
        for k, (i, column, _) in enumerate(pattern.entries):
            if i == row and V[column] is not None:
                factors += pairs(k, V[column])
        return lanes.sum_of_products(factors)

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


@intrinsic(prefer_literal=True)
def _place(typing_context, flat, coefficients, theta, M):
    pattern = unflatten(tuple(number.literal_value for number in flat))
    width = M.shape[1]

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, width)
        coefficients, theta, M = map(lanes.data, signature.args[1:], arguments[1:])
        values = [lanes.load(theta, i) for i in range(pattern.p)]
        ones = ir.Constant(lanes.vector, [1.0] * lanes.part)
        inverses = [tuple(builder.fdiv(ones, part) for part in value) for value in values]
        summands = defaultdict(list)
        for k, (entry, *exponents) in enumerate(pattern.terms):
            c = lanes.scalar(coefficients, INDEX(k))
            product = lanes.value(lanes.insert(lanes.zero, c, 0))
            for value, inverse, e in zip(values, inverses, exponents, strict=True):
                for _ in range(abs(e)):
                    product = lanes.product(product, value if e > 0 else inverse)
            summands[entry].append(product)
        for entry, parts in summands.items():
            total = [reduce(builder.fadd, part) for part in zip(*parts, strict=True)]
            lanes.store(tuple(total), M, entry)
        return context.get_dummy_value()

    return types.void(flat, coefficients, theta, M), emit


@intrinsic(prefer_literal=True)
def _convey(typing_context, flat, M, X, inputs, weights, order, substeps):  # noqa: PLR0917
    pattern = unflatten(tuple(number.literal_value for number in flat))
    width = M.shape[1]

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, width)
        M, X, inputs, weights = (lanes.data(signature.args[i], arguments[i]) for i in (1, 2, 3, 4))
        factors = [lanes.load(M, e) for e in range(len(pattern.entries))]

        def pairs(k, row):
            yield [*zip(factors[k], row, strict=True)]

        _series(lanes, pattern, pairs, X, lanes.load(inputs, 0), (weights, *arguments[5:]))
        return context.get_dummy_value()

    return types.void(flat, M, X, inputs, weights, order, substeps), emit


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


@overload(place, prefer_literal=True)
def _compiled_place(flat, coefficients, theta, M):
    def compiled(flat, coefficients, theta, M):
        _place(flat, coefficients, theta, M)  # type: ignore[call-arg]

    return compiled


@overload(convey, prefer_literal=True)
def _compiled_convey(flat, M, X, inputs, weights, order, substeps):  # noqa: PLR0917
    def compiled(flat, M, X, inputs, weights, order, substeps):  # noqa: PLR0917
        _convey(flat, M, X, inputs, weights, order, substeps)  # type: ignore[call-arg]

    return compiled


@overload(ready)
def _compiled_ready(laws, n, theta, active, D, further):  # noqa: PLR0917
    if isinstance(laws, types.NoneType):
        return lambda laws, n, theta, active, D, further: None

    def compiled(laws, n, theta, active, D, further):  # noqa: PLR0917
        return laws_ready(laws, n, theta, active, D, further)

    return compiled
