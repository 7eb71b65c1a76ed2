"""Emit vector instructions on rows of lanes, a value and its derivatives side by side."""

from collections.abc import Sequence

from llvmlite import ir
from numba.core.cgutils import alloca_once, get_or_insert_function

DOUBLE = ir.DoubleType()
INDEX = ir.IntType(64)
LANE = ir.IntType(32)

CHUNK = 4  # lanes in a register; wider or odder vectors are taken apart badly
Row = tuple[ir.Value, ...]


def has(context, feature: str) -> bool:
    """Return whether the processor that numba compiles for has a feature, such as ``"fma"``."""
    return f"+{feature}" in context.codegen().magic_tuple()[2].split(",")


def multiply_add(context, builder: ir.IRBuilder, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
    """
    Return a·b + c of vectors, rounded once where the processor can.

    It is said and not left to the compiler, which may fuse in one place and not in another: what
    runs alone and what runs beside others must round alike.
    """
    if not has(context, "fma"):
        return builder.fadd(builder.fmul(a, b), c)
    name = f"llvm.fma.v{a.type.count}f64"
    kind = ir.FunctionType(a.type, [a.type] * 3)
    return builder.call(get_or_insert_function(builder.module, kind, name), [a, b, c])


class Lanes:
    """
    Arithmetic on rows of lanes [a, ∂a], each held as some vectors of a register's width.

    Parameters
    ----------
    context, builder
        What numba hands to the code generator of an intrinsic.
    width : int
        Number of lanes in a row; 2, or a multiple of `CHUNK`.
    """

    def __init__(self, context, builder: ir.IRBuilder, width: int) -> None:
        self.context, self.builder = context, builder
        self.part = min(width, CHUNK)
        self.parts = width // self.part
        self.vector = ir.VectorType(DOUBLE, self.part)
        self.nothing = ir.Constant(self.vector, [0.0] * self.part)
        self.zero: Row = (self.nothing,) * self.parts

    def data(self, kind, array) -> ir.Value:
        """Return the address of the first element of a contiguous array."""
        return self.context.make_array(kind)(self.context, self.builder, array).data

    def scalar(self, data: ir.Value, index: ir.Value) -> ir.Value:
        """Load one element."""
        return self.builder.load(self.builder.gep(data, [index]))

    def load(self, data: ir.Value, row: int) -> Row:
        """Load one row."""
        return tuple(self.builder.load(self._at(data, row, c), align=8) for c in range(self.parts))

    def store(self, vectors: Row, data: ir.Value, row: int) -> None:
        """Store one row."""
        for c, vector in enumerate(vectors):
            self.builder.store(vector, self._at(data, row, c), align=8)

    def _at(self, data: ir.Value, row: int, part: int) -> ir.Value:
        element = self.builder.gep(data, [INDEX((row * self.parts + part) * self.part)])
        return self.builder.bitcast(element, self.vector.as_pointer())

    def place(self) -> Row:
        """Return addresses of a row in registers, or on the stack."""
        return tuple(alloca_once(self.builder, self.vector) for _ in range(self.parts))

    def put(self, vectors: Row, place: Row) -> None:
        """Write a row to its place."""
        for vector, address in zip(vectors, place, strict=True):
            self.builder.store(vector, address)

    def get(self, place: Row) -> Row:
        """Read a row from its place."""
        return tuple(self.builder.load(address) for address in place)

    def insert(self, vectors: Row, scalar: ir.Value, lane: int) -> Row:
        """Return the row with one lane replaced."""
        c, i = divmod(lane, self.part)
        changed = self.builder.insert_element(vectors[c], scalar, LANE(i))
        return (*vectors[:c], changed, *vectors[c + 1 :])

    def value(self, vectors: Row) -> Row:
        """Return [a a … a] of [a, ∂a]."""
        lanes = ir.Constant(ir.VectorType(LANE, self.part), [0] * self.part)
        return (self.builder.shuffle_vector(vectors[0], self.nothing, lanes),) * self.parts

    def slope(self, vectors: Row) -> Row:
        """Return [0, ∂a] of [a, ∂a]."""
        return self.insert(vectors, DOUBLE(0.0), 0)

    def product(self, a: Row, b: Row) -> Row:
        """Return a·b."""
        return tuple(self.builder.fmul(x, y) for x, y in zip(a, b, strict=True))

    def fused(self, a: Row, b: Row, c: Row) -> Row:
        """Return a·b + c."""
        return tuple(
            multiply_add(self.context, self.builder, x, y, z)
            for x, y, z in zip(a, b, c, strict=True)
        )

    def sum_of_products(self, pairs: Sequence[Sequence[tuple | None]]) -> Row:
        """Return Σ a·b of pairs of vectors, part by part; where there are none it is zero."""
        by_part = ([pair[c] for pair in pairs] for c in range(self.parts))
        return tuple(self._sum([pair for pair in part if pair is not None]) for part in by_part)

    def _sum(self, pairs: Sequence[tuple]) -> ir.Value:
        total = self.nothing
        for k, (a, b) in enumerate(pairs):
            (total,) = self.fused((a,), (b,), (total,)) if k else self.product((a,), (b,))
        return total
