"""
What laws do to a step of a model: their torques, held over it, solved together and implicitly.

Over a step of length h the linear part is exact for held torques F, x⁺ = Φ x + Γ_u u + Γ_F F, and
every law takes the mean of its drive at both ends, w̄ = ½ D (x + x⁺), so that w̄ = c + G F(w̄) with
c = ½ D (x + Φ x + Γ_u u) and G = ½ D Γ_F. The scheme is of second order, and stays stable however
stiff friction is. Its derivatives are exact, from (I − G F_w) w̄' = c' + G' F + G (F_s s' + F_θ).
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.law_torques import (
    F_S,
    F_W,
    ROLE,
    S_S,
    S_W,
    SHAPE,
    WIDTH,
    F,
    S,
    force,
)
from flexaxis.estimators.models.laws import MOST_ROLES

Array = NDArray[np.float64]

MOST_STEPS = 100  # of the search; two or three do
TURNS = 6  # steps of Newton's method after which laws count as flat where they fall: between two
# solutions it wanders, and each step doubles what rounding leaves
CLOSE = 1e-3  # of w̄, a step from which Newton's method ends the search
AWAY = 8.0  # times the step before, a step that Newton's method does not take then: of 60 000
# steps of steep bristles 2 stay unsolved; with 1 it were 11, without a limit rounding grows by 10⁸
CONVERGED = 1e-7  # of w̄, the last step: of Newton's method what is left is its square
LEAST = 1e-150  # of a scale, so that none, and no square of one, divides by zero
LEAST_SHARE = 1 / 64  # of a step that is taken where steps turn back without shrinking


def room(L: int, lanes: int) -> dict[str, Array]:
    """Return the arrays that `react` works in, for L laws; the first it begins the next search."""
    return {
        "force": np.zeros(L),  # of the last step
        "offset": np.zeros(L),  # c
        "change": np.zeros(L),  # of w̄ in a step of the search
        "roles": np.zeros((L, MOST_ROLES)),
        "local": np.zeros((L, WIDTH)),
        "coupling": np.zeros((L, L)),  # G
        "jacobian": np.zeros((L, L)),
        "inverse": np.zeros((L, L)),
        "before": np.zeros((L, lanes)),  # drives before the step
        "mean": np.zeros((L, lanes)),  # w̄
        "torque": np.zeros((L, lanes)),  # F
        "reach": np.zeros(L),  # of w̄, in the search for it
    }


@compiled
def drives(drive, X, u, w):
    """Write the drives w (L, lanes) of states and derivatives X (≥ n, lanes), and of the input."""
    n = drive.shape[1] - 1
    for i in range(len(drive)):
        for a in range(w.shape[1]):
            w[i, a] = 0.0
        w[i, 0] = drive[i, n] * u
        for j in range(n):
            if drive[i, j] != 0.0:
                for a in range(w.shape[1]):
                    w[i, a] += drive[i, j] * X[j, a]


@compiled
def assign(value, parameter, theta, roles):
    """Write the parameters (L, R) of laws by role, at θ."""
    for i in range(len(roles)):
        for r in range(roles.shape[1]):
            j = parameter[i, r]
            roles[i, r] = value[i, r] * theta[j] if j >= 0 else value[i, r]


@compiled
def couple(drive, response, gain):
    """Write G = ½ D Γ_F."""
    for i in range(len(gain)):
        for j in range(len(gain)):
            gain[i, j] = 0.0
            for m in range(drive.shape[1] - 1):
                gain[i, j] += 0.5 * drive[i, m] * response[j, m, 0]


@compiled
def react(laws, h, response, u, X, work):  # noqa: PLR0917
    """
    Add to a step what laws do in it, with derivatives.

    Parameters
    ----------
    laws : tuple (kind, memory, drive, value, parameter, load)
        As in `flexaxis.estimators.models.acting.Acting`.
    h : float
        Length of the step [s].
    response : (L, N, lanes) array
        Γ_F: what a torque of one, held over the step, adds to each row.
    u : float
    X : (N, lanes) array
        States and output after the step, without laws; corrected here.
    work : tuple of arrays
        Those of `room`, in their order, with roles, coupling and before written.
    """
    drive = laws[2]
    _, _, _, _, local, _, _, _, before, mean, torque, _ = work
    drives(drive, X, u, mean)
    for i in range(len(mean)):
        for a in range(mean.shape[1]):
            mean[i, a] = 0.5 * (mean[i, a] + before[i, a])
    _search(laws, h, u, X, work)
    _differentiate(laws, response, X, work)
    for m in range(len(X)):
        for i in range(len(mean)):
            b, held = response[i, m, 0], local[i, F]
            if b != 0.0:
                X[m, 0] += b * held
                for a in range(1, mean.shape[1]):
                    X[m, a] += b * torque[i, a] + response[i, m, a] * held
    _remember(laws, X, work)


@inlined
def _differentiate(laws, response, X, work):
    """Write w̄' into ``mean``, as (I − G F_w) w̄', and F' into ``torque``; not their first lanes."""
    _, memory, drive, value, parameter, load = laws
    _, _, _, _, local, gain, _, inverse, _, mean, torque, _ = work
    L, lanes = mean.shape
    for i in range(L):  # F_s s' + F_θ
        for a in range(1, lanes):
            torque[i, a] = local[i, F_S] * X[memory[i], a] if memory[i] >= 0 else 0.0
        for r in range(value.shape[1]):
            if parameter[i, r] >= 0:
                torque[i, 1 + parameter[i, r]] += local[i, ROLE + 2 * r] * value[i, r]
    for i in range(L):
        for j in range(L):
            _add(mean[i], gain[i, j], torque[j])
            for m in range(drive.shape[1] - 1):
                if drive[i, m] != 0.0:  # G' F
                    _add(mean[i], 0.5 * drive[i, m] * local[j, F], response[j, m])
    for i in range(L):
        for j in range(L):
            _add(torque[i], local[i, F_W] * inverse[i, j], mean[j])
            if load[i] >= 0:
                _add(torque[i], local[i, F_S] * inverse[load[i], j], mean[j])


@inlined
def _remember(laws, X, work):
    """Take the states that laws have of their own over the step, and keep their torques."""
    kind, memory, _, value, parameter, _ = laws
    torques, _, _, _, local, _, _, inverse, _, mean, _, _ = work
    for i in range(len(mean)):
        torques[i] = local[i, F]
        m = memory[i]
        if m >= 0 and kind[i] != SHAPE:  # which only reads a state
            X[m, 0] = local[i, S]
            for a in range(1, mean.shape[1]):
                X[m, a] *= local[i, S_S]
            for j in range(len(mean)):
                _add(X[m], local[i, S_W] * inverse[i, j], mean[j])
            for r in range(value.shape[1]):
                if parameter[i, r] >= 0:
                    X[m, 1 + parameter[i, r]] += local[i, ROLE + 2 * r + 1] * value[i, r]


@inlined
def _add(row, factor, other):
    """Add a multiple of a row to another, but not of its first lane, which is a value."""
    if factor != 0.0:
        for a in range(1, len(row)):
            row[a] += factor * other[a]


@compiled
def _search(laws, h, u, X, work):
    """
    Solve w̄ = c + G F(w̄) by Newton's method, from the torques of the step before.

    Where friction falls steeply with speed there may be several w̄, and none near the start: then w̄
    follows its residual, as a rule to the next that is stable.

    c is ``mean[:, 0]``, in the place of which w̄ comes; the laws are left in ``local`` as they are
    at w̄, and (I − G F_w)⁻¹ in ``inverse``.
    """
    kind, memory, _, _, _, load = laws
    torques, offset, change, roles, local, gain, jacobian, inverse, _, mean, _, reach = work
    L = len(torques)
    for i in range(L):
        offset[i] = mean[i, 0]
        reach[i] = abs(offset[i])
        for j in range(L):
            mean[i, 0] += gain[i, j] * torques[j]
            reach[i] += abs(gain[i, j] * torques[j])
    for i in range(L):
        torques[i] = 0.0  # they lend their place to steps
    last, share, lost, ended = np.inf, 1.0, False, False
    for n in range(MOST_STEPS):
        for i in range(L):
            s = X[memory[i], 0] if memory[i] >= 0 else 0.0
            if load[i] >= 0:
                s = mean[load[i], 0]
            force(kind[i], mean[i, 0], s, u, h, roles[i], local[i])
        ended = ended or n == MOST_STEPS - 1
        flat = n >= TURNS and (lost or last > CLOSE) and not ended
        _differences(gain, local, load, flat, jacobian)
        _invert(jacobian, inverse)
        if ended:
            break
        size = _newton(offset, change, local, gain, inverse, mean, reach)
        if n > TURNS and not flat and size > AWAY * last:
            lost = True  # no w̄ is so near, or one where the laws are about to fall too steeply
            continue
        if flat:
            share = _kept_share(share, change, torques, reach)
        else:
            # a share s of a step leaves 1 − s of the way if the laws are straight there
            shrinks = size <= (1.0 - 0.5 * share) * last
            share = min(1.0, 2.0 * share) if shrinks else max(0.5 * share, LEAST_SHARE)
        last, ended = size, size <= CONVERGED
        for i in range(L):
            mean[i, 0] += change[i] if ended else share * change[i]


@inlined
def _differences(gain, local, load, flat, jacobian):
    """Write I − G F_w; where laws count as flat, without slopes that make two solutions."""
    for j in range(len(gain)):
        slope = local[j, F_W]
        if flat and gain[j, j] * slope > 0.0:
            slope = 0.0
        for i in range(len(gain)):
            jacobian[i, j] = (1.0 if i == j else 0.0) - gain[i, j] * slope
    for j in range(len(gain)):
        for i in range(len(gain) if load[j] >= 0 else 0):
            jacobian[i, load[j]] -= gain[i, j] * local[j, F_S]


@inlined
def _kept_share(share, change, before, reach):
    """Return the share of a step where laws count as flat: less after a turn; and keep the step."""
    forth = 0.0
    for i in range(len(change)):
        forth += change[i] * before[i] / max(reach[i], LEAST) ** 2
        before[i] = change[i]
    return min(1.0, 2.0 * share) if forth >= 0.0 else max(0.5 * share, LEAST_SHARE)


@inlined
def _newton(offset, change, local, gain, inverse, mean, reach):  # noqa: PLR0917
    """Write the step of Newton's method, and return its size relative to what w̄ is made of."""
    size = 0.0
    for i in range(len(change)):
        change[i] = 0.0
    for j in range(len(change)):
        residual = offset[j] - mean[j, 0]
        for m in range(len(change)):
            residual += gain[j, m] * local[m, F]
        for i in range(len(change)):
            change[i] += inverse[i, j] * residual
    for i in range(len(change)):
        if change[i] != 0.0:
            size = max(size, abs(change[i]) / max(reach[i], LEAST))
    return size


@inlined
def _invert(A, B):
    """Write the inverse B of a small matrix A, which is lost: Gauss–Jordan with pivots."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            B[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        inverse = 1.0 / A[k, k]
        for j in range(n):
            A[k, j] *= inverse
            B[k, j] *= inverse
        for i in range(n):
            factor = A[i, k]
            if i != k and factor != 0.0:
                for j in range(n):
                    A[i, j] -= factor * A[k, j]
                    B[i, j] -= factor * B[k, j]
