"""Numbers of several runs side by side, which emit vector instructions as they are calculated."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from llvmlite import ir
from numba.core.cgutils import alloca_once, get_or_insert_function

from flexaxis.estimators.sampling.emit import DOUBLE, INDEX, LANE, has, multiply_add

WIDE = 8  # runs in a register of AVX-512
NARROW = 4  # in one of AVX2, of half that size


class Runs:
    """
    One number of each of R runs, (R,) in a register; sums and products are rounded as those of one.

    Parameters
    ----------
    side
        The `Side` that they stand on.
    value : (R,) vector
    """

    def __init__(self, side: "Side", value: ir.Value) -> None:
        self.side, self.value = side, value

    def __add__(self, other: "Runs | float") -> "Runs":
        return Runs(self.side, self.side.builder.fadd(self.value, self.side.of(other).value))

    def __sub__(self, other: "Runs | float") -> "Runs":
        return Runs(self.side, self.side.builder.fsub(self.value, self.side.of(other).value))

    def __mul__(self, other: "Runs | float") -> "Runs":
        return Runs(self.side, self.side.builder.fmul(self.value, self.side.of(other).value))

    def __truediv__(self, other: "Runs | float") -> "Runs":
        return Runs(self.side, self.side.builder.fdiv(self.value, self.side.of(other).value))

    def __rtruediv__(self, other: float) -> "Runs":
        return self.side.of(other) / self

    def __neg__(self) -> "Runs":
        return Runs(self.side, self.side.builder.fneg(self.value))

    def __lt__(self, other: "Runs | float") -> "Mask":
        return self._ordered("<", other)

    def __gt__(self, other: "Runs | float") -> "Mask":
        return self._ordered(">", other)

    def __le__(self, other: "Runs | float") -> "Mask":
        return self._ordered("<=", other)

    def __ge__(self, other: "Runs | float") -> "Mask":
        return self._ordered(">=", other)

    def equals(self, other: "Runs | float") -> "Mask":
        """Return which are equal; NaN is equal to nothing."""
        return self._ordered("==", other)

    def _ordered(self, sign: str, other: "Runs | float") -> "Mask":
        other = self.side.of(other)
        return Mask(self.side, self.side.builder.fcmp_ordered(sign, self.value, other.value))

    def finite(self) -> "Mask":
        """Return which are neither infinite nor NaN."""
        return (self - self).equals(0.0)

    def root(self) -> "Runs":
        """Return the square root."""
        build = self.side.builder
        name = f"llvm.sqrt.v{self.side.width}f64"
        kind = ir.FunctionType(self.value.type, [self.value.type])
        function = get_or_insert_function(build.module, kind, name)
        return Runs(self.side, build.call(function, [self.value]))


class Mask:
    """
    Which of R runs something holds for, (R,) bits.

    Parameters
    ----------
    side
        The `Side` that they stand on.
    value : (R,) vector of bits
    """

    def __init__(self, side: "Side", value: ir.Value) -> None:
        self.side, self.value = side, value

    def __and__(self, other: "Mask") -> "Mask":
        return Mask(self.side, self.side.builder.and_(self.value, other.value))

    def __or__(self, other: "Mask") -> "Mask":
        return Mask(self.side, self.side.builder.or_(self.value, other.value))

    def __invert__(self) -> "Mask":
        return Mask(self.side, self.side.builder.not_(self.value))

    def pick(self, yes: "Runs | float", no: "Runs | float") -> Runs:
        """Return the one where it holds, the other where it does not."""
        yes, no = self.side.of(yes), self.side.of(no)
        return Runs(self.side, self.side.builder.select(self.value, yes.value, no.value))


class Side:
    """
    Where numbers of R runs stand side by side: makes, loads and stores them.

    Parameters
    ----------
    context, builder
        What numba hands to the code generator of an intrinsic.
    width : int
        R.
    """

    def __init__(self, context, builder: ir.IRBuilder, width: int) -> None:
        self.context, self.builder, self.width = context, builder, width
        self.vector = ir.VectorType(DOUBLE, width)

    def of(self, value: Runs | float) -> Runs:
        """Return a constant of all runs; what are numbers of runs already, as they are."""
        if isinstance(value, Runs):
            return value
        return Runs(self, ir.Constant(self.vector, [float(value)] * self.width))

    def load(self, data: ir.Value, place: ir.Value) -> Runs:
        """Load the numbers at a place of an array (…, R), counted in R."""
        return Runs(self, self.builder.load(self._at(data, place), align=8))

    def store(self, runs: Runs, data: ir.Value, place: ir.Value) -> None:
        """Store the numbers at a place of an array (…, R), counted in R."""
        self.builder.store(runs.value, self._at(data, place), align=8)

    def _at(self, data: ir.Value, place: ir.Value) -> ir.Value:
        element = self.builder.gep(data, [self.builder.mul(place, INDEX(self.width))])
        return self.builder.bitcast(element, self.vector.as_pointer())

    def gather(self, data: ir.Value, places: Sequence[ir.Value]) -> Runs:
        """Load a number for each run from its own place of an array."""
        build, found = self.builder, ir.Constant(self.vector, ir.Undefined)
        for r, place in enumerate(places):
            number = build.load(build.gep(data, [place]))
            found = build.insert_element(found, number, LANE(r))
        return Runs(self, found)

    def scatter(self, runs: Runs, data: ir.Value, places: Sequence[ir.Value]) -> None:
        """Store the number of each run at its own place of an array."""
        build = self.builder
        for r, place in enumerate(places):
            build.store(build.extract_element(runs.value, LANE(r)), build.gep(data, [place]))

    def flags(self, data: ir.Value, places: Sequence[ir.Value]) -> Mask:
        """Load which are true, each from its own place of an array of bool."""
        build, bytes_ = self.builder, ir.VectorType(ir.IntType(8), self.width)
        found = ir.Constant(bytes_, ir.Undefined)
        for r, place in enumerate(places):
            found = build.insert_element(found, build.load(build.gep(data, [place])), LANE(r))
        return Mask(self, build.icmp_unsigned("!=", found, ir.Constant(bytes_, [0] * self.width)))

    def spread(self, scalar: ir.Value) -> Runs:
        """Return a number that is the same for all runs."""
        build, nothing = self.builder, ir.Constant(self.vector, ir.Undefined)
        first = build.insert_element(nothing, scalar, LANE(0))
        zeros = ir.Constant(ir.VectorType(LANE, self.width), [0] * self.width)
        return Runs(self, build.shuffle_vector(first, nothing, zeros))

    @contextmanager
    def where_any(self, mask: Mask) -> Iterator[None]:
        """Emit code that is run where a mask holds for any run; it has to heed the mask itself."""
        bits = self.builder.bitcast(mask.value, ir.IntType(self.width))
        with self.builder.if_then(self.builder.icmp_unsigned("!=", bits, bits.type(0))):
            yield

    def variable(self, count: int = 1) -> ir.Value:
        """Return the address of numbers that change in a loop; a single one is in a register."""
        return alloca_once(self.builder, self.vector, count)

    def read(self, variable: ir.Value) -> Runs:
        """Return what a variable is."""
        return Runs(self, self.builder.load(variable))

    def write(self, runs: Runs, variable: ir.Value) -> None:
        """Set a variable."""
        self.builder.store(runs.value, variable)

    def fused(self, a: Runs, b: Runs, c: Runs) -> Runs:
        """Return a·b + c, rounded as `emit.Lanes.fused` does."""
        return Runs(self, multiply_add(self.context, self.builder, a.value, b.value, c.value))

    def sum_of_products(self, pairs: Sequence[tuple[Runs, Runs]]) -> Runs | None:
        """Return Σ a·b in the order of `emit.Lanes.sum_of_products`; None where there are none."""
        if not pairs:
            return None
        total = pairs[0][0] * pairs[0][1]
        for a, b in pairs[1:]:
            total = self.fused(a, b, total)
        return total


def width(context) -> int:
    """Return how many runs fit into a register of the processor that numba compiles for."""
    return WIDE if has(context, "avx512f") else NARROW


def at_a_time(context) -> int:
    """Return how many lanes of five states, and of their powers, fit into its registers."""
    return 2 if has(context, "avx512f") else 1
