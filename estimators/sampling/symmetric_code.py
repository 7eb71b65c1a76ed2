"""What numba makes of `sampling.symmetric`: straight-line code for the sizes of the arrays."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from flexaxis.estimators.sampling.emit import DOUBLE, INDEX, LANE, Lanes
from flexaxis.estimators.sampling.symmetric import (
    NOTHING,
    carry,
    look,
    merge,
    padded,
    triangularize_columns,
)


class Rows(Lanes):
    """Arithmetic on rows of P (m, w), and on rows of X (n+1, lanes) behind their first lane."""

    def __init__(self, context, builder: ir.IRBuilder, m: int) -> None:
        super().__init__(context, builder, padded(m))
        self.m = m

    def splat(self, scalar: ir.Value):
        """Return [a a … a]."""
        one = self.builder.insert_element(self.nothing, scalar, LANE(0))
        return self.value((one,) * self.parts)

    def pick(self, vectors, a: int) -> ir.Value:
        """Return one element of a row."""
        c, i = divmod(a, self.part)
        return self.builder.extract_element(vectors[c], LANE(i))

    def behind(self, data: ir.Value, row: int, lanes: int):
        """Load a row of X behind its first lane; the loads stay within it."""
        wide = Lanes(self.context, self.builder, lanes)
        parts = (*wide.load(data, row), wide.nothing)
        shift = ir.Constant(ir.VectorType(LANE, 4), [1, 2, 3, 4])
        return tuple(
            self.builder.shuffle_vector(parts[c], parts[c + 1], shift) for c in range(self.parts)
        )

    def read(self, data: ir.Value):
        """Load a vector of length m."""
        row = self.zero
        for a in range(self.m):
            row = self.insert(row, self.scalar(data, INDEX(a)), a)
        return row

    def times(self, factors, rows):
        """Return Σ_q a_q P_q for scalars a_q and rows P_q."""
        return self.sum_of_products(
            [[*zip(self.splat(a), row, strict=True)] for a, row in zip(factors, rows, strict=True)]
        )

    def dot(self, a, b) -> ir.Value:
        """Return aᵀb."""
        add, shuffle = self.builder.fadd, self.builder.shuffle_vector
        vectors = self.product(a[:1], b[:1])
        for c in range(1, self.parts):
            vectors = self.fused(a[c : c + 1], b[c : c + 1], vectors)
        low, high = (
            shuffle(vectors[0], self.nothing, ir.Constant(ir.VectorType(LANE, 2), two))
            for two in ([0, 1], [2, 3])
        )
        two = add(low, high)
        return add(*(self.builder.extract_element(two, LANE(i)) for i in range(2)))

    def root(self, a: ir.Value) -> ir.Value:
        """Return √a."""
        function = self.builder.module.declare_intrinsic("llvm.sqrt", [DOUBLE])
        return self.builder.call(function, [a])

    def less(self, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
        """Return c − a·b."""
        build = self.builder
        return build.fadd(build.fmul(build.fneg(a), b, flags=("contract",)), c, flags=("contract",))

    def write(self, data: ir.Value, index: int, value: ir.Value) -> None:
        """Store one element."""
        self.builder.store(value, self.builder.gep(data, [INDEX(index)]))


@intrinsic
def _look(typing_context, X, P, Ph):
    (high, lanes), (m,) = X.shape, Ph.shape

    def emit(context, builder, signature, arguments):
        rows = Rows(context, builder, m)
        X, P, Ph = map(rows.data, signature.args, arguments)
        h = rows.behind(X, high - 1, lanes)
        product = rows.times(
            [rows.pick(h, q) for q in range(m)], [rows.load(P, q) for q in range(m)]
        )
        for a in range(m):
            rows.write(Ph, a, rows.pick(product, a))
        return rows.dot(h, product)

    return types.float64(X, P, Ph), emit


@intrinsic
def _carry(typing_context, X, Ph, root, W, P, gain):  # noqa: PLR0917
    (high, lanes), (p, _), (m,) = X.shape, W.shape, gain.shape

    def emit(context, builder, signature, arguments):
        rows = Rows(context, builder, m)
        X, Ph, W, P, gain = (rows.data(signature.args[i], arguments[i]) for i in (0, 1, 3, 4, 5))
        root = arguments[2]
        h = rows.behind(X, high - 1, lanes)
        G = [rows.behind(X, i, lanes) for i in range(m - p)]
        old = [rows.load(P, a) for a in range(m)]
        GP = [rows.times([rows.pick(g, q) for q in range(m)], old) for g in G]
        k = [builder.fmul(root, rows.scalar(Ph, INDEX(a))) for a in range(p)]
        k += [builder.fmul(root, rows.dot(product, h)) for product in GP]
        for a in range(m):
            rows.write(gain, a, k[a])

        def moved(a, b):
            if a < p:
                return builder.fadd(rows.pick(old[a], b), rows.scalar(W, INDEX(a * p + b)))
            return rows.pick(GP[a - p], b) if b < p else rows.dot(GP[a - p], G[b - p])

        for a in range(m):
            for b in range(a + 1):
                value = rows.less(k[a], k[b], moved(a, b))
                rows.write(P, a * rows.parts * rows.part + b, value)
                if b < a:
                    rows.write(P, b * rows.parts * rows.part + a, value)
        return context.get_dummy_value()

    return types.void(X, Ph, root, W, P, gain), emit


@intrinsic
def _merge(typing_context, share, P, other, apart):
    (m,) = apart.shape

    def emit(context, builder, signature, arguments):
        rows = Rows(context, builder, m)
        P, other, apart = (rows.data(signature.args[i], arguments[i]) for i in (1, 2, 3))
        rest = builder.fsub(DOUBLE(1.0), arguments[0])
        root = rows.root(builder.fmul(arguments[0], rest))
        share, rest, root = map(rows.splat, (arguments[0], rest, root))
        e = rows.product(root, rows.read(apart))
        for a in range(m):
            mine = rows.product(rest, rows.load(P, a))
            both = rows.fused(share, rows.load(other, a), mine)
            rows.store(rows.fused(rows.splat(rows.pick(e, a)), e, both), P, a)
        return context.get_dummy_value()

    return types.void(share, P, other, apart), emit


@intrinsic
def _triangularize(typing_context, A, R):
    columns, length = A.shape

    def emit(context, builder, signature, arguments):
        rows = Rows(context, builder, length)
        A, R = map(rows.data, signature.args, arguments)
        rest = [rows.load(A, c) for c in range(columns)]
        for j in range(columns):
            v, rest = rest[0], rest[1:]
            v = tuple(_without(builder, part, j - c * rows.part) for c, part in enumerate(v))
            norm, above, scale = _reflection(rows, v, j)
            rows.write(R, j * columns + j, norm)
            v = rows.insert(v, above, j)
            sign = builder.select(
                builder.fcmp_ordered("<", above, DOUBLE(0.0)), *map(DOUBLE, (1.0, -1.0))
            )
            for c, other in enumerate(rest):
                factor = rows.splat(builder.fmul(rows.dot(v, other), scale))
                rest[c] = rows.fused(factor, v, other)
                value = builder.fmul(sign, rows.pick(rest[c], j))
                rows.write(R, j * columns + j + 1 + c, value)
        return context.get_dummy_value()

    return types.void(A, R), emit


def _without(builder, vector, count):
    """Return a vector with its first elements, so many, set to zero."""
    nothing = ir.Constant(vector.type, [0.0] * vector.type.count)
    lanes = [vector.type.count if i < count else i for i in range(vector.type.count)]
    return builder.shuffle_vector(
        vector, nothing, ir.Constant(ir.VectorType(LANE, len(lanes)), lanes)
    )


def _reflection(rows, v, j):
    """Return |v|, and of the reflection that leaves its element j only, that and −2/|.|²."""
    builder = rows.builder
    square, first = rows.dot(v, v), rows.pick(v, j)
    norm = rows.root(square)
    minus = builder.fcmp_ordered(">", first, DOUBLE(0.0))
    alpha = builder.select(minus, builder.fneg(norm), norm)
    above = builder.fsub(first, alpha)
    scale = builder.fdiv(DOUBLE(1.0), builder.fmul(alpha, above))
    nothing = builder.fcmp_ordered("<=", square, DOUBLE(NOTHING))
    return norm, above, builder.select(nothing, DOUBLE(0.0), scale)


@overload(look)
def _compiled_look(X, P, Ph):
    def compiled(X, P, Ph):
        return _look(X, P, Ph)  # type: ignore[call-arg]

    return compiled


@overload(carry)
def _compiled_carry(X, Ph, root, W, P, gain):  # noqa: PLR0917
    def compiled(X, Ph, root, W, P, gain):  # noqa: PLR0917
        _carry(X, Ph, root, W, P, gain)  # type: ignore[call-arg]

    return compiled


@overload(merge)
def _compiled_merge(share, P, other, apart):
    def compiled(share, P, other, apart):
        _merge(share, P, other, apart)  # type: ignore[call-arg]

    return compiled


@overload(triangularize_columns)
def _compiled_triangularize(A, R):
    def compiled(A, R):
        _triangularize(A, R)  # type: ignore[call-arg]

    return compiled
