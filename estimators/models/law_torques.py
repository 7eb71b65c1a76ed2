"""
Compiled functions that compute the torque of each nonlinear law, and its derivatives.

Each function writes its results to the array ``local``. The first elements of ``local`` are the
torque F, the law's own state s⁺ after the step, and the derivatives of F and s⁺ with respect to two
variables w and s. The variable w is the mean value of the law's driving variable over the step. The
variable s is the law's own state before the step, or the load for a law that depends on a load.
From the index `ROLE` on, ``local`` contains a pair of elements for each parameter of the law: the
derivatives of F and s⁺ with respect to this parameter. The module `flexaxis.estimators.models.laws`
defines the torque laws and the roles of their parameters.
"""

import numpy as np

from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.laws import KINDS
from flexaxis.estimators.models.parametrization import F_S, F_W, ROLE, S_S, S_W, F, S

BRISTLE, STATIC, GEAR, SPRING, SINUSOID, CLIP = (
    KINDS.index(kind) for kind in ("bristle", "static", "gear", "spring", "sinusoid", "clip")
)
SMALL = 0.1  # largest a for which the relaxation functions are computed as series, to round-off
FAST = 20.0  # value of v/v_0 above which tanh equals one within round-off
NEAR = 1e-4  # value of v/v_0 below which x/tanh x equals its series within round-off
LEAST = 1e-100  # N m, smallest friction level of bristles, so that 1/level² remains finite


@inlined
def force(kind, w, s, u, h, value, local):  # noqa: PLR0917
    """
    Compute the torque of a nonlinear law and its derivatives, and write them to ``local``.

    Parameters
    ----------
    kind : int
        Index of the kind of law in `KINDS`.
    w, s : float
        Mean value of the driving variable over the step, and the law's own state before the step.
        For a torque law that depends on a load, s is the load.
    u : float
        Input of the model, which is constant over the step.
    h : float
        Length of the integration step [s].
    value : (R,) array
        Parameters of the torque law, in the order of the roles.
    local : (w,) array
        Array to which the function writes its results.
    """
    local[:] = 0.0
    if kind == BRISTLE:
        _bristle(w, s, h, value, local)
    elif kind == STATIC:
        _static(w, value, local)
    elif kind == GEAR:
        _gear(w, s, u, value, local)
    elif kind == SPRING:
        _spring(w, value, local)
    elif kind == SINUSOID:
        _sinusoid(w, value, local)
    elif kind == CLIP:
        _clip(w, value, local)


@inlined
def _bristle(v, p, h, value, local):
    """
    Integrate the bristle torque p exactly at a constant speed v; F is the mean friction torque.

    Let h be the step length and g the steady-state bristle torque, and let b = σ₀ h v, a = σ₀ h
    |v|/g, φ₁ = (1−e^−a)/a and φ₂ = (1−φ₁)/a. The bristle torque after the step is p⁺ = p e^−a + b
    φ₁. The mean friction torque is F = p φ₁ + b φ₂ + σ₁/σ₀ (p⁺−p)/h.
    """
    stiffness, tau = value[3], value[4] / value[3] / h
    level, level_v, bump, level_s = _sliding(abs(v), value)
    r, r_v, r_0 = _softened(abs(v), value[5])
    rate = stiffness * h / level
    a, b = rate * r, stiffness * h * v
    e, one, two, one_a, two_a = _relaxation(a)
    end = p * e + b * one
    local[F], local[S] = p * one + b * two + tau * (end - p), end
    local[S_S], local[F_S] = e, one + tau * (e - 1.0)
    end_a, mean_a = -p * e + b * one_a, p * one_a + b * two_a
    sign = 1.0 if v >= 0.0 else -1.0
    a_v = sign * rate * (r_v - r * level_v / level)
    local[S_W] = end_a * a_v + one * stiffness * h
    local[F_W] = mean_a * a_v + two * stiffness * h + tau * local[S_W]
    a_level = -a / level
    for role, da in enumerate(
        (a_level, a_level * bump, a_level * level_s, a / stiffness, 0.0, rate * r_0)
    ):
        db = b / stiffness if role == 3 else 0.0
        change = end_a * da + one * db
        local[ROLE + 2 * role + 1] = change
        local[ROLE + 2 * role] = mean_a * da + two * db + tau * change
    local[ROLE + 6] -= tau / stiffness * (end - p)
    local[ROLE + 8] = (end - p) / stiffness / h


@inlined
def _sliding(size, value):
    """Return f_c + f_s exp(−(|v|/v_s)²) and its derivatives with respect to |v|, f_s and v_s."""
    f_c, f_s, v_s = value[0], value[1], value[2]
    bump, level_v, level_s = 0.0, 0.0, 0.0
    if v_s > 0.0:
        bump = np.exp(-((size / v_s) ** 2))
        level_v = -2.0 * f_s * size / v_s**2 * bump
        level_s = 2.0 * f_s * size**2 / v_s**3 * bump
    level = f_c + f_s * bump
    return level if abs(level) > LEAST else LEAST, level_v, bump, level_s


@inlined
def _softened(size, v_0):
    """Return r = |v|/tanh(|v|/v_0), which is finite at v = 0, and both partial derivatives of r."""
    if v_0 <= 0.0 or size > FAST * v_0:
        return size, 1.0, 0.0
    x = size / v_0
    if x < NEAR:
        return v_0 * (1.0 + x * x / 3.0), 2.0 * x / 3.0, 1.0 - x * x / 3.0
    t = np.tanh(x)
    slope = (1.0 - t * t) / (t * t)
    return size / t, 1.0 / t - x * slope, x * x * slope


@inlined
def _relaxation(a):
    """Return e^−a, the bristle functions φ₁(a) and φ₂(a), and the derivatives of φ₁ and φ₂."""
    e = np.exp(-a)
    if a > SMALL:
        one = (1.0 - e) / a
        two = (1.0 - one) / a
        one_a = (e - one) / a
        return e, one, two, one_a, -(one_a + two) / a
    two, two_a, power = 0.0, 0.0, 0.5  # φ₂ = Σ (−a)^k/(k+2)!
    for k in range(10):
        two += power
        power /= k + 3
        two_a -= (k + 1) * power
        power *= -a
    return e, 1.0 - a * two, two, -two - a * two_a, two_a


@inlined
def _static(v, value, local):
    """Compute the friction torque F = [f_c + f_s/cosh(α v)] tanh(β v) of a static law."""
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
def _gear(v, twist, u, value, local):
    """
    Compute the friction torque F = [f_c + |L| + (f_s + |L_s|) e^(−|v/v_s|^α)] tanh(v/v_0).

    The load is L = μ_e r k_g x + μ_m k_T u. The load L_s at low speed is μ_es r k_g x + μ_ms k_T u.
    """
    f_s, v_s, alpha, v_0 = value[1], value[2], value[3], value[8]
    gear, motor = value[11] * value[10] * twist, value[9] * u
    x, t = abs(v) / v_s, np.tanh(v / v_0)
    power = x**alpha
    e = np.exp(-power)
    fast, by_gear, by_motor = _load(gear, motor, value[5], value[4])
    slow, slow_gear, slow_motor = _load(gear, motor, value[7], value[6])
    excess = f_s + slow
    level, steep = value[0] + fast + excess * e, (1.0 - t * t) / v_0
    fall = excess * e * alpha * power * t  # contribution of the excess to −∂F/∂ ln|v|
    local[F] = level * t
    local[F_W] = level * steep - (fall / v if x > 0.0 else 0.0)
    for role, slope in enumerate(
        (
            t,
            e * t,
            fall / v_s,
            -excess * e * power * np.log(x) * t if x > 0.0 else 0.0,
            by_motor * motor * t,
            by_gear * gear * t,
            slow_motor * motor * e * t,
            slow_gear * gear * e * t,
            -level * steep * v / v_0,
        )
    ):
        local[ROLE + 2 * role] = slope
    gear_share = (by_gear * value[5] + slow_gear * value[7] * e) * t
    motor_share = (by_motor * value[4] + slow_motor * value[6] * e) * t
    local[F_S] = gear_share * value[11] * value[10]
    local[ROLE + 18], local[ROLE + 20] = motor_share * u, gear_share * value[11] * twist
    local[ROLE + 22] = gear_share * value[10] * twist


@inlined
def _load(gear, motor, of_gear, of_motor):
    """Return |L| for the load L, and the derivatives of |L| with respect to both summands of L."""
    load = of_gear * gear + of_motor * motor
    if load == 0.0:  # if both coefficients are zero, each can only grow
        return 0.0, 1.0 if gear >= 0.0 else -1.0, 1.0 if motor >= 0.0 else -1.0
    side = 1.0 if load > 0.0 else -1.0
    return abs(load), side, side


@inlined
def _spring(x, value, local):
    """Compute the spring torque F = d + κ d³ − x; d is the part of the twist x outside the gap."""
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
def _sinusoid(angle, value, local):
    """Compute the torque F = a sin(N φ) + b cos(N φ) at the angle φ."""
    a, b, poles = value[0], value[1], value[2]
    sine, cosine = np.sin(poles * angle), np.cos(poles * angle)
    local[F] = a * sine + b * cosine
    turned = a * cosine - b * sine
    local[F_W] = poles * turned
    local[ROLE], local[ROLE + 2], local[ROLE + 4] = sine, cosine, angle * turned


@inlined
def _clip(u, value, local):
    """Compute the torque F that limits the input u, where F is the clipped input minus u."""
    limit = value[0]
    if abs(u) > limit:
        side = 1.0 if u > 0.0 else -1.0
        local[F], local[F_W], local[ROLE] = side * limit - u, -1.0, side
