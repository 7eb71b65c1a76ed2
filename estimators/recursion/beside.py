"""
A measurement of several runs side by side: `recursion.measurement` with masks for its conditions.

Function by function the same sums and products in the same order, so that a run is to the last bit
what it is alone, as long as all of its numbers are finite. What one run does and others do not is
kept by masks. P and Σ are computed on one triangle, and mirrored.
"""

from collections.abc import Iterator

from flexaxis.estimators.recursion.astray import ABSURD, FAR, FORETOLD, HEEDS_NOTHING
from flexaxis.estimators.recursion.measurement import ASLEEP, FINEST, KNOWN, LINEAR
from flexaxis.estimators.sampling.fields import Fields
from flexaxis.estimators.sampling.runs import Mask, Runs

NAN = float("nan")
Matrix = list[list[Runs]]


def measure(tuning: Fields, state: Fields, y: Runs, valid: Mask) -> None:
    """Update η, P and Σ, eq. (5)–(7), and project η on the box, as `measurement.measure` does."""
    theta, psi = state.row("theta"), gradient(state)
    expected = state["X", -1, 0]
    state["expected"], state["epsilon"], state["variance"] = expected, NAN, NAN
    gain, form = times(square(state, "P"), psi)
    scale = form + 1.0
    put_row(state, valid, "gain", gain)
    state.put(valid, "scale", scale)
    state.put(~valid, "reading", NAN)
    watched = valid & (tuning["watched"] > 0.0)
    stuck = repeats(tuning, state, y, scale, watched)
    valid = valid & ~(watched & stuck)
    epsilon, weight = y - expected, 1.0 / scale
    spread, form = times(square(state, "claim"), psi)
    total = form + 1.0
    state.put(valid, "epsilon", epsilon)
    state.put(valid, "quiet", state["noise"])
    put_row(state, valid, "spread", spread)
    judged = (state["samples"] >= KNOWN) | (tuning["known"] > 0.0)
    some = judged | (state["samples"] > 0.0)
    state.put(valid & some, "variance", state["noise"] * total)
    surprise = limited(tuning, state, epsilon, scale, judged, some)
    state.put(valid, "surprise", surprise)
    subtract(state, valid, gain, weight)
    carry(state, valid, gain, weight, spread, total)
    excited = learn(tuning, state, valid, surprise * surprise / total)
    explains(tuning, state, y, epsilon, excited & (tuning["heeds"] < HEEDS_NOTHING))
    step = surprise * weight
    for i, before in enumerate(theta):
        after = valid.pick(before + gain[i] * step, before)
        lower, upper = tuning["lower", i], tuning["upper", i]
        after = (after < lower).pick(lower, (after > upper).pick(upper, after))
        state["theta", i] = after
        state["moved", i] = after - before


def gradient(state: Fields) -> list[Runs]:
    """Return ψ, and keep it."""
    psi = [state["X", -1, 1 + i] for i in range(state.size("psi"))]
    for i, each in enumerate(psi):
        state["psi", i] = each
    return psi


def put_row(state: Fields, mask: Mask, name: str, values: list[Runs]) -> None:
    """Set the numbers of a field with one index where a mask holds."""
    for i, value in enumerate(values):
        state.put(mask, (name, i), value)


def square(state: Fields, name: str) -> Matrix:
    """Return a symmetric matrix from its lower triangle."""
    p = range(state.size(name))
    return [[state[name, max(i, j), min(i, j)] for j in p] for i in p]


def triangle(p: int) -> Iterator[tuple[int, int]]:
    """Yield the places of the lower triangle."""
    return ((i, j) for i in range(p) for j in range(i + 1))


def put_both(state: Fields, name: str, i: int, j: int, value: Runs) -> None:
    """Set an element of a symmetric matrix."""
    state[name, i, j] = value
    if i != j:
        state[name, j, i] = value


def times(P: Matrix, psi: list[Runs]) -> tuple[list[Runs], Runs]:
    """Return P ψ and ψᵀ P ψ, as `measurement.form` does."""
    gain = [dot(row, psi) for row in P]
    return gain, dot(psi, gain)


def dot(a: list[Runs], b: list[Runs]) -> Runs:
    """Return Σ a·b, each product rounded."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def repeats(tuning: Fields, state: Fields, y: Runs, scale: Runs, watched: Mask) -> Mask:
    """Return which readings are of stuck sensors, as `measurement.sticks` and `astray.repeats`."""
    known = (state["samples"] >= KNOWN) | (tuning["known"] > 0.0)
    variance = known.pick(state["noise"], state["earlier"]) * scale
    expected = state["expected"]
    below = y < state["rails", 0]
    above = ~below & (y > state["rails", 1])
    state.put(watched & below, ("rails", 0), NAN)
    state.put(watched & above, ("rails", 1), NAN)
    finite = expected.finite()
    state.put(watched & ~finite, "anew", 2.0)
    same = y.equals(state["reading"])
    new, again = watched & finite & ~same, watched & finite & same
    state.put(new, "reading", y)
    at_rail = y.equals(state["rails", 0]) | y.equals(state["rails", 1])
    moved = expected - state["foreseen"]
    free = state["stuck"].equals(0.0)
    caught = again & free & (moved * moved > variance * (FAR * FAR))
    state.put(new, "foreseen", expected)
    state.put(new, "stuck", at_rail.pick(1.0, 0.0))
    released = new & ~at_rail & (state["doubted"] > 0.0)
    state.put(released, "doubted", 0.0)
    state.put(released & (state["anew"] < 1.0), "anew", 1.0)  # lost before is lost still
    state.put(caught, "stuck", 1.0)
    state.put(caught, "doubted", 1.0)
    high = expected > y
    state.put(caught & high, ("rails", 1), y)
    state.put(caught & ~high, ("rails", 0), y)
    waits = state["waits"] > 0.0
    state.put(watched & waits, "waits", state["waits"] - 1.0)
    return waits | (state["stuck"] > 0.0)


def limited(  # noqa: PLR0917
    tuning: Fields, state: Fields, epsilon: Runs, scale: Runs, judged: Mask, some: Mask
) -> Runs:
    """Return the residual, or as much of it as one may have, as `measurement.limited` does."""
    noise, least = state["noise"], state["signal"] * (LINEAR * LINEAR)
    finest = (least > noise).pick(least, noise)
    limit = tuning["clip"] * (finest * scale).root()
    early = KNOWN / state["samples"]
    limit = judged.pick(limit, limit * (early * early))
    clipped = (epsilon > limit).pick(limit, (epsilon < -limit).pick(-limit, epsilon))
    return ((tuning["clip"] > 0.0) & some).pick(clipped, epsilon)


def learn(tuning: Fields, state: Fields, valid: Mask, square: Runs) -> Mask:
    """Take squared residuals into R̂, as `measurement.learn` does; return who is excited."""
    psi = state.row("psi")
    noise, samples, expected = state["noise"], state["samples"], state["expected"]
    asleep = (samples > 0.0).pick(noise * ASLEEP, 0.0)
    excited = valid & (dot(psi, psi) > asleep)
    more, memory = samples + 1.0, tuning["memory"]
    samples = (memory < more).pick(memory, more)
    signal = state["signal"]
    signal = signal + (expected * expected - signal) / samples
    state.put(excited, "samples", samples)
    state.put(excited, "signal", signal)
    noise = noise + (square / tuning["consistency"] - noise) / samples
    least = signal * (FINEST * FINEST)
    noise = (least > noise).pick(least, noise)
    state.put(excited & (tuning["known"] <= 0.0), "noise", noise)
    return excited


def explains(tuning: Fields, state: Fields, y: Runs, epsilon: Runs, taken: Mask) -> None:
    """Mark runs that are lost, as `astray.explains` does where nothing is learnt once."""
    signal, noise = state["signal"], state["noise"]
    expected = state["expected"] * state["expected"]
    usual = (expected > signal).pick(expected, signal)
    usual = (noise > usual).pick(noise, usual)
    taken = taken & ~(y * y > usual * (ABSURD * ABSURD))
    judged, memory = state["judged"] + 1.0, tuning["astray_memory"]
    count = (memory < judged).pick(memory, judged)
    left, whole, foretold = state.row("squares")
    left = left + (epsilon * epsilon - left) / count
    whole = whole + (y * y - whole) / count
    foretold = foretold + (epsilon * state["last_left"] - foretold) / count
    put_row(state, taken, "squares", [left, whole, foretold])
    state.put(taken, "judged", judged)
    state.put(taken, "last_left", epsilon)
    lost = (left > tuning["left"] * whole) & (foretold > left * FORETOLD)
    gone = lost.pick(state["gone"] + 1.0, 0.0)
    state.put(taken, "gone", gone)
    patience = state["patience"]
    limit = patience * memory
    due, lost = taken & (judged >= limit), gone >= limit
    state.put(due & lost, "patience", patience * 2.0)
    state.put(due & lost, "anew", 2.0)
    state.put(due & ~lost & gone.equals(0.0), "patience", tuning["least_patience"])


def subtract(state: Fields, mask: Mask, v: list[Runs], w: Runs) -> None:
    """P ← P − w v vᵀ, as `measurement.subtract` does."""
    for i, j in triangle(len(v)):
        P = state["P", i, j]
        put_both(state, "P", i, j, mask.pick(P - w * v[i] * v[j], P))


def carry(  # noqa: PLR0917
    state: Fields, valid: Mask, gain: list[Runs], weight: Runs, spread: list[Runs], scale: Runs
) -> None:
    """Update Σ as `measurement.carry` does."""
    K = [each * weight for each in gain]
    for i, j in triangle(len(K)):
        claim = state["claim", i, j]
        change = scale * K[i] * K[j] - K[i] * spread[j] - spread[i] * K[j]
        put_both(state, "claim", i, j, valid.pick(claim + change, claim))


def correct_state(tuning: Fields, state: Fields) -> None:
    """Move state and output to where the new θ would have taken them, x ← x + z Δθ."""
    correct = tuning["correct"] > 0.0
    with state.side.where_any(correct):
        moved = state.row("moved")
        for i in range(state.size("X")):
            x = state["X", i, 0]
            for j, each in enumerate(moved):
                x = x + state["X", i, 1 + j] * each
            state.put(correct, ("X", i, 0), x)


def predict(tuning: Fields, state: Fields) -> None:
    """Update P in time, eq. (9) or (10), and regularise it, eq. (12), as `measurement.predict`."""
    p = state.size("P")
    for i, j in triangle(p):
        P = tuning["inflation", i, j] * state["P", i, j] + tuning["drift", i, j]
        put_both(state, "P", i, j, P)
    for axis in range(p):
        mu = tuning["regularization", axis]
        regular = mu > 0.0
        with state.side.where_any(regular):
            column = [state["P", i, axis] for i in range(p)]
            subtract(state, regular, column, mu / (mu * column[axis] + 1.0))
            put_row(state, regular, "gain", column)
    bound(tuning, state)


def bound(tuning: Fields, state: Fields) -> None:
    """Keep P below its ceiling, as `measurement.bound` does."""
    p = state.size("P")
    early = (state["samples"] < KNOWN) & (tuning["known"] <= 0.0)
    ceiling = tuning["ceiling"] / state["noise"]
    for i in range(p):
        granted = state["granted", i]
        most = early.pick(tuning["early", i], ceiling)
        most = (granted > most).pick(granted, most)
        above = state["P", i, i] > most
        with state.side.where_any(above):
            factor = above.pick((most / state["P", i, i]).root(), 1.0)
            for j in range(p):
                P = state["P", i, j] * factor
                put_both(state, "P", i, j, P * factor if i == j else P)
        inside = state["P", i, i]
        less = ~above & (inside < granted)
        floor = tuning["floor", i]
        state.put(less, ("granted", i), (floor > inside).pick(floor, inside))
