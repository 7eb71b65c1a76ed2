"""
An implicit solution for nonlinear torques, which are treated as constant over a step.

For constant torques F, the linear part of the model has the exact solution x⁺ = Φ x + Γ_u u + Γ_F F
over a step of length h. Each torque law uses the mean of the two values of its driving variable at
the start and at the end of the step. These means are w̄ = ½ D (x + x⁺), where D contains the
coefficients of the driving variables. Therefore w̄ = c + G F(w̄) with c = ½ D (x + Φ x + Γ_u u) and
G = ½ D Γ_F. The equations of all torque laws are solved simultaneously. The integration scheme is
of second order and is stable for any friction stiffness. The exact derivatives w̄' of the mean
driving variables follow from (I − G F_w) w̄' = c' + G' F + G (F_s s' + F_θ), where a subscript of F
denotes a derivative, and s contains the states and loads of the laws.
"""

import numpy as np

from flexaxis.estimators.models.compiler import fused, inlined
from flexaxis.estimators.models.law_torques import force
from flexaxis.estimators.models.laws import MOST_ROLES
from flexaxis.estimators.models.matrix_rows import add, add_slopes
from flexaxis.estimators.models.parametrization import F_S, F_W, ROLE, S_S, S_W, F, S

MOST_STEPS = 100  # largest number of steps of the search; two or three usually suffice
TURNS = 6  # number of Newton steps after which torques that fall with their driving variable count
# as constant: otherwise the method would not converge between two solutions, and each step would
# double the rounding error
CLOSE = 1e-3  # size of a step relative to w̄ below which Newton's method may finish the search
AWAY = 8.0  # largest ratio of successive Newton steps after the first TURNS. Of 60 000 steps with
# steep bristles, 2 remain unsolved; with a limit of 1, 11 remain unsolved. Without a limit,
# rounding errors grow by a factor of 10⁸
CONVERGED = 1e-7  # size of the last step relative to w̄; the relative error is about its square
LEAST = 1e-150  # smallest scale, so that dividing by the scale or its square does not overflow
LEAST_SHARE = 1 / 64  # smallest fraction of a step if the steps reverse without becoming smaller


@fused
def half_drives(drive, X, u, w):
    """
    Compute half the value of each driving variable, w = ½ D [x; u], and the derivatives of w.

    The states x and their derivatives are the first rows of X (≥ n, lanes). The function writes its
    results to ``w`` (L, lanes).
    """
    n = drive.shape[1] - 1
    for i in range(len(drive)):
        w[i] = 0.0
        w[i, 0] = 0.5 * drive[i, n] * u
        for j in range(n):
            if drive[i, j] != 0.0:
                add(w, i, 0.5 * drive[i, j], X, j)


@inlined
def assign(laws, theta):
    """For each torque law, write the parameter values at θ to the field ``roles``."""
    for i in range(len(laws)):
        law = laws[i]
        for r in range(MOST_ROLES):
            j = law["parameter"][r]
            law["roles"][r] = law["value"][r] * theta[j] if j >= 0 else law["value"][r]


@fused
def react(axis, h, u, X):
    """
    After a step, add the effects of all nonlinear torques to the states and their derivatives.

    Parameters
    ----------
    axis : Axis
        Arrays of the model. The array ``laws`` (L,) contains the law parameters at θ. The array
        ``drive`` (L, n+1) contains the coefficients D of the n states and of the input in the
        driving variables of the laws. The array ``response`` (L, N, lanes) contains the change Γ_F
        that a constant unit torque causes in each row of X over a step. The array ``coupling`` (L,
        L, lanes) contains the columns of G = ½ D Γ_F, the effect of the torques on the mean driving
        variables. The array ``lanes[0]`` (L, lanes) contains half the values of the driving
        variables before the step. The function writes the mean driving variables w̄ to ``lanes[1]``
        and the torques F to ``lanes[2]``, with all derivatives. The function also overwrites
        ``work`` (L, 2 L), whose right half becomes (I − G F_w)⁻¹.
    h : float
        Length of the integration step [s].
    u : float
        Input of the model, which is constant over the step.
    X : (N, lanes) array
        States and output after the integration step. The caller computes X without the nonlinear
        torques, and `react` corrects X.
    """
    laws, response, coupling, work = axis.laws, axis.response, axis.coupling, axis.work
    before, mean, torque = axis.lanes[0], axis.lanes[1], axis.lanes[2]
    half_drives(axis.drive, X, u, mean)
    for i in range(len(mean)):
        add(mean, i, 1.0, before, i)
    _search(laws, h, u, X, coupling, work, mean)
    _differentiate(laws, coupling, work, X, mean, torque)
    for i in range(len(mean)):
        held = laws[i]["local"][F]
        for m in range(len(X)):
            b = response[i, m, 0]
            if b != 0.0:
                value = X[m, 0] + b * held
                add(X, m, b, torque, i)
                add(X, m, held, response[i], m)
                X[m, 0] = value
    _remember(laws, work, mean, X)


@fused
def _differentiate(laws, coupling, work, X, mean, torque):  # noqa: PLR0917
    """Write the derivatives (I − G F_w) w̄' to ``mean`` and F' to ``torque``, except for lane 0."""
    L = len(laws)
    for i in range(L):
        law = laws[i]
        torque[i] = 0.0
        if law["memory"] >= 0:
            add_slopes(torque, i, law["local"][F_S], X, law["memory"])
        _add_parameters(law, 0, torque, i)
    for i in range(L):
        for j in range(L):
            add_slopes(mean, i, coupling[j, i, 0], torque, j)
            add_slopes(mean, i, laws[j]["local"][F], coupling[j], i)
    for i in range(L):
        for j in range(L):
            slope = laws[i]["local"][F_W] * work[i, L + j]
            if laws[i]["load"] >= 0:
                slope += laws[i]["local"][F_S] * work[laws[i]["load"], L + j]
            add_slopes(torque, i, slope, mean, j)


@fused
def _add_parameters(law, which, A, i):
    """Add the θ derivatives of a law's torque (``which`` = 0) or own state (1) to the row A_i."""
    for r in range(MOST_ROLES):
        if law["parameter"][r] >= 0:
            A[i, 1 + law["parameter"][r]] += law["local"][ROLE + 2 * r + which] * law["value"][r]


@fused
def _remember(laws, work, mean, X):
    """Integrate the states of all torque laws over the step, and store the torques."""
    L = len(laws)
    for i in range(L):
        law = laws[i]
        law["force"] = law["local"][F]
        m = law["memory"]
        if m >= 0:
            for a in range(1, X.shape[1]):
                X[m, a] *= law["local"][S_S]
            X[m, 0] = law["local"][S]
            for j in range(L):
                add_slopes(X, m, law["local"][S_W] * work[i, L + j], mean, j)
            _add_parameters(law, 1, X, m)


@inlined
def _search(laws, h, u, X, coupling, work, mean):  # noqa: PLR0917
    """
    Solve w̄ = c + G F(w̄) by Newton's method; the search starts from the torques of the last step.

    If friction decreases steeply with speed, the equation for w̄ can have several solutions,
    possibly far from the initial value. If Newton's method does not converge, w̄ moves in the
    direction of the residual, usually to the next stable solution.

    The array ``mean[:, 0]`` contains c before the search and w̄ after the search. After the search,
    ``local`` of each law contains the torque and the derivatives at w̄, and the right half of
    ``work`` contains (I − G F_w)⁻¹.
    """
    L = len(laws)
    for i in range(L):
        law = laws[i]
        law["offset"] = mean[i, 0]
        law["reach"] = abs(law["offset"])
        for j in range(L):
            mean[i, 0] += coupling[j, i, 0] * laws[j]["force"]
            law["reach"] += abs(coupling[j, i, 0] * laws[j]["force"])
    for i in range(L):
        laws[i]["force"] = 0.0  # stores the last step during the search
    last, share, lost, ended = np.inf, 1.0, False, False
    for n in range(MOST_STEPS):
        for i in range(L):
            law = laws[i]
            s = X[law["memory"], 0] if law["memory"] >= 0 else 0.0
            if law["load"] >= 0:
                s = mean[law["load"], 0]
            force(law["kind"], mean[i, 0], s, u, h, law["roles"], law["local"])
        ended = ended or n == MOST_STEPS - 1
        flat = n >= TURNS and (lost or last > CLOSE) and not ended
        _differences(laws, coupling, flat, work)
        _invert(work)
        if ended:
            break
        size = _newton(laws, coupling, work, mean)
        if n > TURNS and not flat and size > AWAY * last:
            lost = True  # no solution is that close, or the solution is at a steep fall
            continue
        # after a fraction s of a step, 1 − s of the distance remains if the laws are linear
        nears = _goes_on(laws) if flat else size <= (1.0 - 0.5 * share) * last
        share = min(1.0, 2.0 * share) if nears else max(0.5 * share, LEAST_SHARE)
        last, ended = size, size <= CONVERGED
        for i in range(L):
            mean[i, 0] += laws[i]["change"] if ended else share * laws[i]["change"]


@inlined
def _differences(laws, coupling, flat, work):
    """Write [I − G F_w, I] to ``work``; if ``flat``, omit slopes that cause multiple solutions."""
    L = len(laws)
    for i in range(L):
        for j in range(L):
            work[i, j] = work[i, L + j] = 1.0 if i == j else 0.0
    for j in range(L):
        slope, load = laws[j]["local"][F_W], laws[j]["load"]
        if flat and coupling[j, j, 0] * slope > 0.0:
            slope = 0.0
        for i in range(L):
            work[i, j] -= coupling[j, i, 0] * slope
            if load >= 0:
                work[i, load] -= coupling[j, i, 0] * laws[j]["local"][F_S]


@inlined
def _goes_on(laws):
    """Store a search step, and return whether its direction agrees with that of the last step."""
    forth = 0.0
    for i in range(len(laws)):
        law = laws[i]
        forth += law["change"] * law["force"] / max(law["reach"], LEAST) ** 2
        law["force"] = law["change"]
    return forth >= 0.0


@inlined
def _newton(laws, coupling, work, mean):
    """Store the next step of Newton's method, and return its size relative to w̄."""
    L, size = len(laws), 0.0
    for i in range(L):
        laws[i]["change"] = 0.0
    for j in range(L):
        residual = laws[j]["offset"] - mean[j, 0]
        for m in range(L):
            residual += coupling[m, j, 0] * laws[m]["local"][F]
        for i in range(L):
            laws[i]["change"] += work[i, L + j] * residual
    for i in range(L):
        size = max(size, abs(laws[i]["change"]) / max(laws[i]["reach"], LEAST))
    return size


@inlined
def _invert(work):
    """Transform [A, I] into [I, A⁻¹] by Gauss–Jordan elimination with pivoting."""
    for k in range(len(work)):
        pivot = k
        for i in range(k + 1, len(work)):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        scale = 1.0 / work[pivot, k]
        for j in range(work.shape[1]):
            work[pivot, j], work[k, j] = work[k, j], scale * work[pivot, j]
        for i in range(len(work)):
            factor = work[i, k]
            if i != k and factor != 0.0:
                for j in range(work.shape[1]):
                    work[i, j] -= factor * work[k, j]
