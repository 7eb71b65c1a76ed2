"""Emit vector instructions on rows of lanes, a value and its derivatives side by side."""

from collections.abc import Sequence

from llvmlite import ir

DOUBLE = ir.DoubleType()
INDEX = ir.IntType(64)
LANE = ir.IntType(32)
FUSE = ("contract",)  # a·b + c in one instruction, rounded once; nothing is reordered


class Lanes:
    """
    Arithmetic on rows of lanes [a, ∂a].

    Parameters
    ----------
    context, builder
        What numba hands to the code generator of an intrinsic.
    width : int
        Number of lanes in a row.
    """

    def __init__(self, context, builder: ir.IRBuilder, width: int) -> None:
        self.context, self.builder = context, builder
        self.row = ir.VectorType(DOUBLE, width)
        self.zero = ir.Constant(self.row, [0.0] * width)

    def data(self, kind, array) -> ir.Value:
        """Return the address of the first element of a contiguous array."""
        return self.context.make_array(kind)(self.context, self.builder, array).data

    def scalar(self, data: ir.Value, index: ir.Value) -> ir.Value:
        """Load one element."""
        return self.builder.load(self.builder.gep(data, [index]))

    def load(self, data: ir.Value, row: int) -> ir.Value:
        """Load one row."""
        return self.builder.load(self._at(data, row), align=8)

    def store(self, vector: ir.Value, data: ir.Value, row: int) -> None:
        """Store one row."""
        self.builder.store(vector, self._at(data, row), align=8)

    def _at(self, data: ir.Value, row: int) -> ir.Value:
        element = self.builder.gep(data, [INDEX(row * self.row.count)])
        return self.builder.bitcast(element, self.row.as_pointer())

    def insert(self, vector: ir.Value, scalar: ir.Value, lane: int) -> ir.Value:
        """Return the row with one lane replaced."""
        return self.builder.insert_element(vector, scalar, LANE(lane))

    def value(self, vector: ir.Value) -> ir.Value:
        """Return [a a … a] of [a, ∂a]."""
        lanes = ir.Constant(ir.VectorType(LANE, self.row.count), [0] * self.row.count)
        return self.builder.shuffle_vector(vector, self.zero, lanes)

    def slope(self, vector: ir.Value) -> ir.Value:
        """Return [0, ∂a] of [a, ∂a]."""
        return self.insert(vector, DOUBLE(0.0), 0)

    def fused(self, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
        """Return a·b + c."""
        return self.builder.fadd(self.builder.fmul(a, b, flags=FUSE), c, flags=FUSE)

    def sum_of_products(self, pairs: Sequence[tuple[ir.Value, ir.Value]]) -> ir.Value:
        """Return Σ a·b, zero for no pairs."""
        total = self.zero
        for k, (a, b) in enumerate(pairs):
            total = self.fused(a, b, total) if k else self.builder.fmul(a, b)
        return total
