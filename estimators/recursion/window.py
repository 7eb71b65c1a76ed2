"""
The least-squares fit of `methods.moving_horizon` to a window that moves along, compiled.

``setting`` and ``state`` are a `Setting` and a `Window` of that module. Loops stand where NumPy's
assignment to slices would read better, which takes far longer to compile.
"""

import numpy as np

from flexaxis.estimators.recursion.level import FINEST, KNOWN, MOVING, ODD
from flexaxis.estimators.recursion.square_root import bound_root, cholesky, forward, triangularize
from flexaxis.estimators.sampling.compiler import compiled, inlined
from flexaxis.estimators.sampling.sampled import sample


@compiled
def horizon_loop(tuning, state, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples, as `flexaxis.estimators.recursion.loop.sample_loop`."""
    terms, setting = tuning
    p = len(setting.lower)
    for k in range(len(u)):
        if state.taken[0] == 0:
            _sample(terms, state, p)
            _judge(state, y[k], valid[k])
        else:
            _predict(state)
            j = state.taken[1]
            state.u[j], state.y[j] = state.held[0], _judge(state, y[k], valid[k])
            state.present[j] = not np.isnan(state.y[j])
            state.taken[1] += 1
            if state.taken[0] % setting.every == 0:
                _solve(terms, setting, state)
        state.held[0] = u[k]
        state.taken[0] += 1
        for i in range(p):
            estimates[k, i] = state.xi[i]
        for i in range(3):
            trace[k, i] = state.shown[i]


@compiled
def _sample(terms, state, p):
    """Sample the model at θ̂."""
    theta, active = np.zeros(p), np.arange(p)
    for i in range(p):
        theta[i] = state.xi[i]
    D = sample(terms, theta, active)
    for a in range(D.shape[0]):
        for i in range(D.shape[1]):
            for j in range(D.shape[2]):
                state.D[a, i, j] = D[a, i, j]


@inlined
def _put(x, Z, state):
    """Keep a prediction and its sensitivities."""
    for i in range(len(x)):
        state.x[i] = x[i]
        for j in range(Z.shape[1]):
            state.Z[i, j] = Z[i, j]


@inlined
def _predict(state):
    """Take the prediction one sample on, under the torque that was held."""
    x, Z = np.zeros(len(state.x)), np.zeros(state.Z.shape)
    _forward(state.D, state.x, state.Z, x, Z, state.held[0])
    _put(x, Z, state)


@inlined
def _judge(state, y, valid):
    """Keep the innovation and its variance; return y as it is to be used, or NaN if it is not."""
    m, last = len(state.xi), len(state.x) - 1
    spread = 0.0
    for i in range(m):
        total = 0.0
        for j in range(m):
            total += state.half[i, j] * state.Z[last, j]
        spread += total**2
    known = state.level[0] > 0.0
    variance = state.level[0] * (1.0 + spread)
    state.shown[0], state.shown[1] = state.x[last], np.nan
    state.shown[2] = variance if known else np.nan
    if not valid:
        state.shown[2] = np.nan
        return np.nan
    e = state.shown[1] = y - state.x[last]
    limit, alone = ODD * np.sqrt(variance), state.level[1] == 0.0
    state.level[1] = 1.0 if known and abs(e) > limit else 0.0
    if state.level[1] == 0.0:
        return y
    if alone:
        return np.nan
    return state.x[last] + (limit if e > 0.0 else -limit)


@compiled
def _solve(terms, setting, state):
    """Minimise over the window from where ξ is, and move it on if it is full."""
    p, length = len(setting.lower), state.taken[1]
    before = np.zeros(len(state.xi))
    for _ in range(setting.iterations):
        for i in range(len(before)):
            before[i] = state.xi[i]
        H, g = _run(setting, state, length)
        _publish(setting, state, _minimum(state, H, g))
        _sample(terms, state, p)
    end, slopes = np.zeros(len(state.x)), np.zeros(state.Z.shape)
    for i in range(len(end)):  # from where it was linearised to ξ̂
        end[i] = state.x[i]
        for j in range(len(before)):
            slopes[i, j] = state.Z[i, j]
            end[i] += slopes[i, j] * (state.xi[j] - before[j])
    if length == len(state.u):
        H, g = _run(setting, state, setting.every)
        _move(setting, state, _minimum(state, H, g))
    _put(end, slopes, state)


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
def _run(setting, state, stop):
    """
    Predict the first samples of the window from ξ̂ into x and Z, and learn R̂ from a whole one.

    Returns
    -------
    H : (m, m) array
        Σ φφᵀ, φ = ∂ŷ/∂ξ.
    g : (m,) array
        Σ φ (y − ŷ).
    """
    p, m = len(setting.lower), len(state.xi)
    n, D, H, g = m - p, state.D, np.zeros((m, m)), np.zeros(m)
    x, Z = np.zeros(n + 1), np.zeros((n + 1, m))
    x_next, Z_next = np.zeros(n + 1), np.zeros((n + 1, m))
    square, count, least = 0.0, 0, MOVING**2 * state.level[0]
    for i in range(n):
        x[i] = state.xi[p + i]
        Z[i, p + i] = 1.0
    for k in range(stop):
        _forward(D, x, Z, x_next, Z_next, state.u[k])
        x, x_next = x_next, x
        Z, Z_next = Z_next, Z
        if state.present[k]:
            residual = state.y[k] - x[n]
            if x[n] ** 2 > least:
                square += residual**2 + (FINEST * x[n]) ** 2
                count += 1
            for i in range(m):
                g[i] += Z[n, i] * residual
                for j in range(m):
                    H[i, j] += Z[n, i] * Z[n, j]
    enough = count >= KNOWN or (count > 0 and state.taken[0] < len(state.u))
    if enough and stop == state.taken[1] and not setting.known:
        state.level[0] = square / count
    _put(x, Z, state)
    return H, g


@inlined
def _forward(D, x, Z, x_next, Z_next, u):  # noqa: PLR0917
    """Take state, output (n+1,) and their sensitivities by ξ (n+1, m) over one sample."""
    p, n, m = len(D) - 1, len(x) - 1, Z.shape[1]
    x[n] = u
    for i in range(n + 1):
        x_next[i] = 0.0
        for a in range(m):
            Z_next[i, a] = 0.0
        for j in range(n + 1):
            x_next[i] += D[0, i, j] * x[j]
            for a in range(p):
                Z_next[i, a] += D[1 + a, i, j] * x[j]
            if j < n:
                for a in range(m):
                    Z_next[i, a] += D[0, i, j] * Z[j, a]


@compiled
def _minimum(state, H, g):
    """
    Return half = [C⁻¹S ξ] (m, m+1): a root of the covariance after the data, and the minimum.

    The sum of squares is taken as linear in ξ. With ξ = ξ̄ + Sᵀz the arrival cost is |z|², so that
    P̄ needs no inverse: A z = S (g + H (ξ̂ − ξ̄)), A = I + S H Sᵀ = C Cᵀ.
    """
    S, m = state.root, len(g)
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
    """Drop the oldest samples from the window, and take ξ̄ and S through them, to x and Z."""
    p, m, every, x, Z = len(setting.lower), len(state.xi), setting.every, state.x, state.Z
    growth = 1.0  # nothing is forgotten before anything is seen
    if state.level[0] > 0.0:
        growth = setting.forgetting ** (-0.5 * every)
    array = np.zeros((m, m))
    for i in range(m):  # F = [I 0; Z] takes a deviation through the samples
        state.mean[i] = half[i, m] if i < p else x[i - p]
        for j in range(m):
            if i < p:
                array[j, i] = growth * half[j, i]
            else:
                state.mean[i] += Z[i - p, j] * (half[j, m] - state.xi[j])
                for k in range(m):
                    array[j, i] += growth * half[j, k] * Z[i - p, k]
    triangularize(array, m, m)
    for i in range(m):
        if i >= p:
            state.xi[i] = x[i - p]
        for j in range(m):
            state.root[i, j] = array[i, j] if j >= i else 0.0
    if state.level[0] > 0.0:
        bound_root(state.root, setting.ceiling, state.level[0])
    state.taken[1] -= every
    for k in range(state.taken[1]):
        state.u[k], state.y[k] = state.u[k + every], state.y[k + every]
        state.present[k] = state.present[k + every]
