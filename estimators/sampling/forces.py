"""
The torque of each kind of law over a step, with its derivatives, in compiled code.

Every function writes into ``local``: the torque F, its derivatives by the drive w and by the law's
own state s, then s⁺ at the end of the step and its derivatives by w and by s, and from `ROLE` on
the derivatives of F and of s⁺ by the law's parameters, in pairs. w is the mean drive of the step.
Laws and roles: `flexaxis.estimators.models.laws`.
"""

import numpy as np

from flexaxis.estimators.models.laws import KINDS, MOST_ROLES
from flexaxis.estimators.sampling.compiler import compiled, inlined

F, F_W, F_S, S, S_W, S_S, ROLE = range(7)
WIDTH = ROLE + 2 * MOST_ROLES
BRISTLE, STATIC, SPRING, SINUSOID, CLIP = (
    KINDS.index(kind) for kind in ("bristle", "static", "spring", "sinusoid", "clip")
)
SMALL = 0.1  # below it the relaxation functions are taken from their series, to round-off
FAST = 20.0  # of v/v_0: tanh is one to round-off
LEAST = 1e-300  # [N m] a bristle's level, so that none divides by zero


@compiled
def force(kind, w, s, h, value, local):  # noqa: PLR0917
    """
    Write the torque of a law and its derivatives.

    Parameters
    ----------
    kind : int
    w, s : float
        Mean drive over the step, and the law's own state before it.
    h : float
        Length of the step [s].
    value : (R,) array
        Parameters by role.
    local : (`WIDTH`,) array
        Overwritten.
    """
    for i in range(len(local)):
        local[i] = 0.0
    if kind == BRISTLE:
        bristle(w, s, h, value, local)
    elif kind == STATIC:
        static(w, value, local)
    elif kind == SPRING:
        spring(w, value, local)
    elif kind == SINUSOID:
        sinusoid(w, value, local)
    elif kind == CLIP:
        clip(w, value, local)


@inlined
def bristle(v, p, h, value, local):
    """
    Relax the torque p of the bristles at a constant speed v, exactly, and take its mean.

    With b = σ₀ h v, a = σ₀ h |v|/g and φ₁ = (1−e^−a)/a, φ₂ = (1−φ₁)/a:
    p⁺ = p e^−a + b φ₁, F = p φ₁ + b φ₂ + σ₁/σ₀ (p⁺−p)/h.
    """
    f_c, f_s, v_s = value[0], value[1], value[2]
    stiffness, damping, v_0 = value[3], value[4], value[5]
    size, sign = abs(v), 1.0 if v >= 0.0 else -1.0
    bump, bump_v, bump_s = 0.0, 0.0, 0.0  # exp(−(v/v_s)²) and its derivatives by |v| and v_s
    if v_s > 0.0:
        bump = np.exp(-((size / v_s) ** 2))
        bump_v, bump_s = -2.0 * size / v_s**2 * bump, 2.0 * size**2 / v_s**3 * bump
    level = f_c + f_s * bump
    # |v|/g stays finite at rest if the sign of v is soft: r = |v|/tanh(|v|/v_0)
    r, r_v, r_0 = size, 1.0, 0.0
    if v_0 > 0.0 and size < FAST * v_0:
        x = size / v_0
        if x < 1e-4:
            r, r_v, r_0 = v_0 * (1.0 + x * x / 3.0), 2.0 * x / 3.0, 1.0 - x * x / 3.0
        else:
            t = np.tanh(x)
            slope = (1.0 - t * t) / (t * t)
            r, r_v, r_0 = size / t, 1.0 / t - x * slope, x * x * slope
    if abs(level) < LEAST:
        level = LEAST
    rate = stiffness * h / level  # a = rate · r
    a, b = rate * r, stiffness * h * v
    e, one, two, one_a, two_a = relaxation(a)
    end = p * e + b * one
    tau = damping / stiffness / h
    local[F] = p * one + b * two + tau * (end - p)
    local[S] = end
    end_a, mean_a = -p * e + b * one_a, p * one_a + b * two_a
    end_b, mean_b = one, two
    local[S_S] = e
    local[F_S] = one + tau * (e - 1.0)
    level_v = f_s * bump_v
    a_v = sign * rate * (r_v - r * level_v / level)
    b_v = stiffness * h
    local[S_W] = end_a * a_v + end_b * b_v
    local[F_W] = mean_a * a_v + mean_b * b_v + tau * local[S_W]
    a_level = -a / level
    for role in range(6):
        da, db, more = 0.0, 0.0, 0.0
        if role == 0:
            da = a_level
        elif role == 1:
            da = a_level * bump
        elif role == 2:
            da = a_level * f_s * bump_s
        elif role == 3:
            da, db = a / stiffness, b / stiffness
            more = -tau / stiffness * (end - p)
        elif role == 4:
            more = (end - p) / stiffness / h
        else:
            da = rate * r_0
        change = end_a * da + end_b * db
        local[ROLE + 2 * role + 1] = change
        local[ROLE + 2 * role] = mean_a * da + mean_b * db + tau * change + more


@inlined
def relaxation(a):
    """Return e^−a, φ₁, φ₂ and the derivatives of φ₁ and φ₂."""
    e = np.exp(-a)
    if a > SMALL:
        one = (1.0 - e) / a
        two = (1.0 - one) / a
        one_a = (e - one) / a
        return e, one, two, one_a, -(one_a + two) / a
    one, two, one_a, two_a, power = 0.0, 0.0, 0.0, 0.0, 1.0  # Σ (−a)^k/(k+1)!, /(k+2)!
    for k in range(10):
        one += power
        two += power / (k + 2)
        one_a -= power * (k + 1) / (k + 2)
        two_a -= power * (k + 1) / ((k + 2) * (k + 3))
        power *= -a / (k + 2)
    return e, one, two, one_a, two_a


@inlined
def static(v, value, local):
    """F = [f_c + f_s/cosh(α v)] tanh(β v)."""
    f_c, f_s, alpha, beta = value[0], value[1], value[2], value[3]
    bell, fall = 1.0 / np.cosh(alpha * v), np.tanh(alpha * v)
    t = np.tanh(beta * v)
    level, steep = f_c + f_s * bell, 1.0 - t * t
    local[F] = level * t
    local[F_W] = level * beta * steep - f_s * alpha * bell * fall * t
    local[ROLE], local[ROLE + 2] = t, bell * t
    local[ROLE + 4] = -f_s * v * bell * fall * t
    local[ROLE + 6] = level * v * steep


@inlined
def spring(x, value, local):
    """F = d + κ d³ − x, with d what of x lies outside the gap."""
    kappa, half = value[0], 0.5 * value[1]
    d, side = 0.0, 0.0
    if x > half:
        d, side = x - half, 1.0
    elif x < -half:
        d, side = x + half, -1.0
    slope = (1.0 + 3.0 * kappa * d * d) * side * side
    local[F] = d + kappa * d**3 - x
    local[F_W] = slope - 1.0
    local[ROLE], local[ROLE + 2] = d**3, -0.5 * side * slope


@inlined
def sinusoid(angle, value, local):
    """F = a sin(N φ) + b cos(N φ)."""
    a, b, poles = value[0], value[1], value[2]
    sine, cosine = np.sin(poles * angle), np.cos(poles * angle)
    local[F] = a * sine + b * cosine
    turned = a * cosine - b * sine
    local[F_W] = poles * turned
    local[ROLE], local[ROLE + 2], local[ROLE + 4] = sine, cosine, angle * turned


@inlined
def clip(u, value, local):
    """F = u clipped to ± the limit, less u."""
    limit = value[0]
    if abs(u) > limit:
        side = 1.0 if u > 0.0 else -1.0
        local[F], local[F_W], local[ROLE] = side * limit - u, -1.0, side
