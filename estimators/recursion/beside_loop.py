"""The loop of the prediction-error method over the samples of several runs side by side."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from flexaxis.estimators.recursion.beside import correct_state, measure, predict
from flexaxis.estimators.sampling.beside import Entries, advance, entries
from flexaxis.estimators.sampling.compiler import Compiled, remembered
from flexaxis.estimators.sampling.emit import INDEX
from flexaxis.estimators.sampling.fields import Fields, layout_of
from flexaxis.estimators.sampling.pattern import Pattern, unflatten
from flexaxis.estimators.sampling.runs import Runs, Side


@remembered
def beside_loop(pattern: Pattern, records: tuple[int, ...], width: int) -> Compiled:
    """
    Return the compiled loop of `methods.rpem` for several runs of models of this pattern.

    Parameters
    ----------
    pattern : Pattern
        Of a model without laws.
    records : tuple of int
        As from `flexaxis.estimators.sampling.fields.layout`, of the records of tuning and state.
    width : int
        Runs side by side, R.

    Returns
    -------
    callable
        ``run(tuning, state, series, u, y, valid, estimates, trace)`` takes samples: records are
        arrays (words, R), ``series`` is (weights, order, substeps), signals and ``valid`` are
        (R, N), ``estimates`` (R, N, p) and ``trace`` (R, N, 3) are written.
    """
    flat = (width, *pattern.flat())

    def run(tuning, state, series, u, y, valid, estimates, trace):  # noqa: PLR0917
        weights, order, substeps = series
        for k in range(u.shape[1]):
            _take(
                flat, records, tuning, state, weights, order, substeps,
                k, u.shape[1], u, y, valid, estimates, trace,
            )  # type: ignore[call-arg]  # fmt: skip

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter (prediction error, {width} runs) for {size}")


@intrinsic(prefer_literal=True)
def _take(  # noqa: PLR0917
    typing_context, flat, records, tuning, state, weights, order, substeps,
    k, N, u, y, valid, estimates, trace,
):  # fmt: skip
    width, *rest = (number.literal_value for number in flat)
    pattern = unflatten(tuple(rest))
    layouts = layout_of(tuple(number.literal_value for number in records))
    given = (flat, records, tuning, state, weights, order, substeps,
             k, N, u, y, valid, estimates, trace)  # fmt: skip

    def emit(context, builder, signature, arguments):
        side = Side(context, builder, width)
        data = [
            context.make_array(kind)(context, builder, value).data
            if isinstance(kind, types.Array)
            else value
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        _, _, tuning, state, weights, order, substeps, k, N, u, y, valid, estimates, trace = data
        records = Fields(side, tuning, layouts[0]), Fields(side, state, layouts[1])
        places = [builder.add(builder.mul(N, INDEX(r)), k) for r in range(width)]
        measure(*records, side.gather(y, places), side.flags(valid, places))
        correct_state(*records)
        predict(*records)
        _publish(records[1], estimates, trace, places)
        _over(side, pattern, records, side.gather(u, places), (weights, order, substeps))
        return context.get_dummy_value()

    return types.void(*given), emit


def _publish(state: Fields, estimates: ir.Value, trace: ir.Value, places: list) -> None:
    """Write what `flexaxis.estimators.recursion.measurement.publish` does."""
    side, build = state.side, state.side.builder
    said = [state["expected"], state["epsilon"], state["variance"]]
    for array, numbers in ((estimates, state.row("theta")), (trace, said)):
        for i, each in enumerate(numbers):
            own = [build.add(build.mul(k, INDEX(len(numbers))), INDEX(i)) for k in places]
            side.scatter(each, array, own)


def _over(
    side: Side, pattern: Pattern, records: tuple[Fields, Fields], u: Runs, series: tuple
) -> None:
    """Take X over a sample, as `flexaxis.estimators.sampling.over` does."""
    tuning, state = records
    lanes = range(1 + pattern.p)
    found = entries(pattern, tuning.row("coefficients"), state.row("theta"))
    for entry, row in found.items():
        for a in lanes:
            state["M", entry, a] = row[a] or 0.0
    M: Entries = {
        k: found.get(k) or [state["M", k, 0], *[None] * pattern.p]
        for k in range(len(pattern.entries))
    }
    X = [[state["X", i, a] for a in lanes] for i in range(pattern.n)]
    for i, numbers in enumerate(advance(side, pattern, M, X, u, series)):
        for a in lanes:
            state["X", i, a] = numbers[a]
