"""
The least-squares fit of `methods.moving_horizon` to a window that moves along, compiled.

``series``, ``setting`` and ``state`` are a `Series`, a `Setting` and a `Window` of
`flexaxis.estimators.filters.horizon`. Loops stand where NumPy's assignment to slices would read
better, which takes far longer to compile.
"""

import numpy as np

from flexaxis.estimators.filters.covariance import ahead, gather
from flexaxis.estimators.filters.noise import FINEST, KNOWN, MOVING, ODD
from flexaxis.estimators.filters.square_root import bound_root, cholesky, forward, triangularize
from flexaxis.estimators.models.compiler import Compiled, compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern
from flexaxis.estimators.models.kernel import advance, evaluate


@remembered
def _sampler(pattern: Pattern) -> Compiled:
    """Return what samples models of this pattern."""
    entries, series_of = evaluate(pattern), advance(pattern)

    @compiled
    def resample(series, state):
        """Sample the model at θ̂."""
        X, theta = state.unit, state.theta
        for i in range(len(theta)):
            theta[i] = state.xi[i]
        entries(series.coefficients, theta, state.M)
        for column in range(len(X)):
            _begin(X, column, len(theta))
            u = 1.0 if column == len(X) - 1 else 0.0
            series_of(state.M, X, u, series.weights, series.order, series.substeps)
            for i in range(len(X)):
                for a in range(1 + len(theta)):
                    state.D[i, column, a] = X[i, a]

    return resample


@remembered
def _follower(n: int, p: int) -> Compiled:
    """Return what follows the window, for so many states and parameters."""
    over, add = ahead(n, p), gather(n, p)

    @compiled
    def follow(setting, state, stop):
        """Predict the first samples of the window from ξ̂ into X, and gather the fit to them."""
        X, H, g, n = state.X, state.H, state.g, len(state.X) - 1
        square, count, least = 0.0, 0, MOVING**2 * state.level[0]
        _start(state)
        for k in range(stop):
            over(state.D, X, state.u[k])
            if state.present[k]:
                residual = state.y[k] - X[n, 0]
                if X[n, 0] ** 2 > least:
                    square += residual**2 + (FINEST * X[n, 0]) ** 2
                    count += 1
                add(X, residual, H, g)
        enough = count >= KNOWN or (count > 0 and state.taken[0] < len(state.u))
        if enough and stop == state.taken[1] and not setting.known:
            state.level[0] = square / count

    return follow


@remembered
def _solver(pattern: Pattern) -> Compiled:
    """Return what does a window, for models of this pattern."""
    resample, follow = _sampler(pattern), _follower(pattern.n, pattern.p)

    @compiled
    def solve(series, setting, state):
        """Minimise over the window from where ξ is, and move it on if it is full."""
        X, length, m = state.X, state.taken[1], len(state.xi)
        before, end = np.zeros(m), np.zeros(X.shape)
        for _ in range(setting.iterations):
            for i in range(m):
                before[i] = state.xi[i]
            follow(setting, state, length)
            _publish(setting, state, _minimum(state))
            resample(series, state)
        for i in range(len(X)):  # from where it was linearised to ξ̂
            for a in range(1 + m):
                end[i, a] = X[i, a]
            for j in range(m):
                end[i, 0] += X[i, 1 + j] * (state.xi[j] - before[j])
        if length == len(state.u):
            follow(setting, state, setting.every)
            _move(setting, state, _minimum(state))
        for i in range(len(X)):
            for a in range(1 + m):
                X[i, a] = end[i, a]

    return solve


@remembered
def horizon_loop(pattern: Pattern) -> Compiled:
    """Return the compiled loop for models of this pattern."""
    over, resample, solve = ahead(pattern.n, pattern.p), _sampler(pattern), _solver(pattern)

    def run(tuning, state, u, y, valid, estimates, trace):  # noqa: PLR0917
        series, setting = tuning
        for k in range(len(u)):
            if state.taken[0] == 0:
                resample(series, state)
                _judge(state, y[k], valid[k])
            else:
                over(state.D, state.X, state.held[0])
                j = state.taken[1]
                state.u[j], state.y[j] = state.held[0], _judge(state, y[k], valid[k])
                state.present[j] = not np.isnan(state.y[j])
                state.taken[1] += 1
                if state.taken[0] % setting.every == 0:
                    solve(series, setting, state)
            state.held[0] = u[k]
            state.taken[0] += 1
            for i in range(estimates.shape[1]):
                estimates[k, i] = state.xi[i]
            for i in range(3):
                trace[k, i] = state.shown[i]

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter (a moving horizon) for {size}")


@inlined
def _begin(X, column, p):
    """Set rows of lanes to one state of one, without derivatives."""
    for i in range(len(X)):
        for a in range(1 + p):
            X[i, a] = 1.0 if i == column and a == 0 else 0.0


@inlined
def _start(state):
    """Set X to ξ̂, and H and g to zero."""
    X, H, g = state.X, state.H, state.g
    p = len(state.theta)
    for i in range(len(X)):
        for a in range(X.shape[1]):
            X[i, a] = 1.0 if a == 1 + p + i and i < len(X) - 1 else 0.0
        if i < len(X) - 1:
            X[i, 0] = state.xi[p + i]
    for b in range(len(g)):
        g[b] = 0.0
        for a in range(len(H)):
            H[a, b] = 0.0


@inlined
def _judge(state, y, valid):
    """Keep the innovation and its variance; return y as it is to be used, or NaN if it is not."""
    m, X = len(state.xi), state.X
    spread = 0.0
    for i in range(m):
        total = 0.0
        for j in range(m):
            total += state.half[i, j] * X[-1, 1 + j]
        spread += total**2
    known = state.level[0] > 0.0
    variance = state.level[0] * (1.0 + spread)
    state.shown[0], state.shown[1] = X[-1, 0], np.nan
    state.shown[2] = variance if known else np.nan
    if not valid:
        state.shown[2] = np.nan
        return np.nan
    e = state.shown[1] = y - X[-1, 0]
    limit, alone = ODD * np.sqrt(variance), state.level[1] == 0.0
    state.level[1] = 1.0 if known and abs(e) > limit else 0.0
    if state.level[1] == 0.0:
        return y
    if alone:
        return np.nan
    return X[-1, 0] + (limit if e > 0.0 else -limit)


@compiled
def _publish(setting, state, half):
    """Take ξ̂, with θ̂ in the box, and its covariance."""
    p, m = len(setting.lower), len(state.xi)
    for i in range(m):
        for j in range(m):
            state.half[i, j] = half[i, j]
        state.xi[i] = half[i, m]
        if i < p:
            if state.xi[i] < setting.lower[i]:  # not min and max, which would hide a NaN
                state.xi[i] = setting.lower[i]
            elif state.xi[i] > setting.upper[i]:
                state.xi[i] = setting.upper[i]
    reach = state.taken[1] * (1.0 - setting.forgetting)
    share = state.level[0] * (reach + 0.5) / (reach + 1.0)
    for i in range(p):
        for j in range(p):
            state.claimed[i, j] = 0.0
            for k in range(m):
                state.claimed[i, j] += share * half[k, i] * half[k, j]


@compiled
def _minimum(state):
    """
    Return half = [C⁻¹S ξ] (m, m+1): a root of the covariance after the data, and the minimum.

    The sum of squares is taken as linear in ξ. With ξ = ξ̄ + Sᵀz the arrival cost is |z|², so that
    P̄ needs no inverse: A z = S (g + H (ξ̂ − ξ̄)), A = I + S H Sᵀ = C Cᵀ.
    """
    S, H, g, m = state.root, state.H, state.g, len(state.xi)
    A, half, HS = np.zeros((m, m)), np.zeros((m, m + 1)), np.zeros((m, m))
    for i in range(m):
        total = g[i]
        for j in range(m):
            total += H[i, j] * (state.xi[j] - state.mean[j])
            for k in range(m):
                HS[i, j] += H[i, k] * S[j, k]
        for j in range(m):
            half[j, m] += S[j, i] * total
    for i in range(m):
        A[i, i] = 1.0
        for j in range(m):
            half[i, j] = S[i, j]
            for k in range(m):
                A[i, j] += S[i, k] * HS[k, j]
    cholesky(A)
    forward(A, half)
    xi = np.zeros(m)
    for i in range(m):  # Sᵀz = (C⁻¹S)ᵀ C⁻¹(…)
        xi[i] = state.mean[i]
        for k in range(m):
            xi[i] += half[k, i] * half[k, m]
    for i in range(m):
        half[i, m] = xi[i]
    return half


@compiled
def _move(setting, state, half):
    """Drop the oldest samples from the window, and take ξ̄ and S through them, to X."""
    p, m, every, X = len(setting.lower), len(state.xi), setting.every, state.X
    growth = 1.0  # nothing is forgotten before anything is seen
    if state.level[0] > 0.0:
        growth = setting.forgetting ** (-0.5 * every)
    array = np.zeros((m, m))
    for i in range(m):  # F = [I 0; Z] takes a deviation through the samples
        state.mean[i] = half[i, m] if i < p else X[i - p, 0]
        for j in range(m):
            if i < p:
                array[i, j] = growth * half[j, i]
            else:
                state.mean[i] += X[i - p, 1 + j] * (half[j, m] - state.xi[j])
                for k in range(m):
                    array[i, j] += growth * half[j, k] * X[i - p, 1 + k]
    triangularize(array, state.root)
    for i in range(m):
        if i >= p:
            state.xi[i] = X[i - p, 0]
        for j in range(m):
            if j < i:
                state.root[i, j] = 0.0
    if state.level[0] > 0.0:
        bound_root(state.root, setting.ceiling, state.level[0])
    state.taken[1] -= every
    for k in range(state.taken[1]):
        state.u[k], state.y[k] = state.u[k + every], state.y[k + every]
        state.present[k] = state.present[k + every]
