"""What numba makes of `sampling.dense`: straight-line code for its sizes."""

from numba import types
from numba.extending import intrinsic, overload

from flexaxis.estimators.sampling.dense import ahead, gather
from flexaxis.estimators.sampling.emit import INDEX, Lanes
from flexaxis.estimators.sampling.symmetric import padded
from flexaxis.estimators.sampling.symmetric_code import Rows


@intrinsic(prefer_literal=True)
def _ahead(typing_context, sizes, D, X, u):
    n, p = (number.literal_value for number in sizes)

    def emit(context, builder, signature, arguments):
        lanes = Lanes(context, builder, padded(1 + p + n))
        few = Lanes(context, builder, padded(1 + p))
        D, X = (few.data(signature.args[i], arguments[i]) for i in (1, 2))
        rows = [lanes.load(X, j) for j in range(n)]
        slopes = [lanes.slope(row) for row in rows]
        values = [lanes.value(row)[: few.parts] for row in rows]
        torque = few.value(few.insert(few.zero, arguments[3], 0))
        rest = (None,) * (lanes.parts - few.parts)
        width = few.parts * few.part

        def pairs(i):
            for j in range(n + 1):
                entry = i * (n + 1) + j
                yield [
                    *zip(few.load(D, entry), torque if j == n else values[j], strict=True),
                    *rest,
                ]
                if j < n:
                    a = lanes.scalar(D, INDEX(entry * width))
                    a = lanes.value(lanes.insert(lanes.zero, a, 0))
                    yield [*zip(a, slopes[j], strict=True)]

        moved = [lanes.sum_of_products([*pairs(i)]) for i in range(n + 1)]
        for i, row in enumerate(moved):
            lanes.store(row, X, i)
        return context.get_dummy_value()

    return types.void(sizes, D, X, u), emit


@intrinsic(prefer_literal=True)
def _gather(typing_context, sizes, X, residual, H, g):  # noqa: PLR0917
    n, p = (number.literal_value for number in sizes)

    def emit(context, builder, signature, arguments):
        rows = Rows(context, builder, p + n)
        X, H, g = (rows.data(signature.args[i], arguments[i]) for i in (1, 3, 4))
        phi = rows.behind(X, n, padded(1 + p + n))
        for a in range(p + n):
            scalar = rows.splat(rows.pick(phi, a))
            rows.store(rows.fused(scalar, phi, rows.load(H, a)), H, a)
        residual = rows.splat(arguments[2])
        rows.store(rows.fused(residual, phi, rows.load(g, 0)), g, 0)
        return context.get_dummy_value()

    return types.void(sizes, X, residual, H, g), emit


@overload(ahead, prefer_literal=True)
def _compiled_ahead(sizes, D, X, u):
    def compiled(sizes, D, X, u):
        _ahead(sizes, D, X, u)  # type: ignore[call-arg]

    return compiled


@overload(gather, prefer_literal=True)
def _compiled_gather(sizes, X, residual, H, g):
    def compiled(sizes, X, residual, H, g):
        _gather(sizes, X, residual, H, g)  # type: ignore[call-arg]

    return compiled
