"""`relocate` on models with laws: what is learnt once, what data ask for, the measured angle."""

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import BRISTLES, N1, real_axis
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.relocate.entry import relocate_friction
from flexaxis.estimators.relocate.finding import LOST, interval_of
from flexaxis.estimators.relocate.follow import angle_of, follow, turn
from flexaxis.estimators.relocate.needed import TRUST, Posterior, Question, needed, weight
from flexaxis.estimators.relocate.replay import replay
from flexaxis.estimators.relocate.screen import screen
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.sampling.prepared import prepare, travel
from flexaxis.estimators.sampling.sampled import planned

T = 0.005
LAW = {"f_c": 0.1, "f_s": 0.05, "v_s": 0.5, "sigma_0": 100.0, "sigma_1": 0.3, "v_0": 0.1}


def one_mass_with_friction(names=("k_T", "J_m", "f_m", "f_c")):
    """A motor with dry friction, in parameters relative to their values."""
    model = Model(
        "motor", states=("speed_motor",), A=(("-f_m/J_m",),), B=("k_T/J_m",), C=("1",),
        nominal={"k_T": 1.0, "J_m": 6e-3, "f_m": 0.05, **LAW}, laws=(BRISTLES,),
    )  # fmt: skip
    wide = model.parametrize(names)
    relative = wide.relative(wide.theta)
    box = np.full(len(names), 0.4), np.full(len(names), 2.5)
    return planned(relative, *box, T), box


def shaken(N, rng):
    """A torque that turns the motor round now and then."""
    u = np.cumsum(rng.standard_normal(N))
    return np.c_[0.6 * np.sin(u / 5), np.zeros(N)]


def test_the_screen_is_right_where_the_linearisation_varies():
    terms, (lower, upper) = one_mass_with_friction()
    rng, theta, active, N = np.random.default_rng(0), np.ones(4), np.arange(4), 60
    u, x = shaken(N, rng), np.r_[1.0, np.zeros(terms.n - 1)]
    present = np.ones(N, bool)
    present[20:23] = False
    y = rng.standard_normal(N)
    gains, steps = np.empty((N, 4)), np.empty((N, 4))
    for onset in range(N):  # the textbook way: one simulation for each
        prepared, psi, epsilon = prepare(terms, theta, active), np.zeros((N, 4)), np.zeros(N)
        X, moved = np.zeros((2, 5, terms.n + 1))
        X[0, :-1] = x
        for k in range(N):
            X[1:] *= k > onset  # the state at the onset does not depend on what follows
            travel(prepared, X, moved, u[k, 0])
            X, moved = moved, X
            psi[k], epsilon[k] = X[1:, -1] * (k >= onset), y[k] - X[0, -1]
        g = psi[present].T @ epsilon[present] / 0.3
        H = np.sum(psi[present] ** 2, axis=0) / 0.3 + 1 / 0.5**2
        steps[onset] = np.clip(g / H, -0.6, 1.5)
        gains[onset] = g * steps[onset] - (H * steps[onset] ** 2 + np.log(H * 0.5**2)) / 2
    found = screen(terms, theta, active, x, u, y, present, 0.3, lower, upper, 0.5)
    np.testing.assert_array_equal(found[0], gains.argmax(axis=0))
    np.testing.assert_allclose(found[1], steps[found[0], range(4)], rtol=1e-6)
    np.testing.assert_allclose(found[2], gains.max(axis=0), rtol=1e-6)


def test_what_is_learnt_is_never_forgotten():
    roles = Roles(given=1, tracked=2, known=3, candidates=np.arange(4))
    fading = roles.fading(0.81, 4)
    f, h, one = 0.81, 0.9, 1.0
    expected = [[f, f, h, f], [f, f, h, f], [h, h, one, h], [f, f, h, f]]
    np.testing.assert_allclose(fading, expected)


def test_a_replay_begins_from_what_was_known_and_walks():
    terms, _ = one_mass_with_friction(("k_T", "f_m"))
    rng, N, theta = np.random.default_rng(1), 80, np.array([1.0, 1.1])
    u, x = shaken(N + 1, rng), np.zeros(terms.n)
    prepared, X, moved = prepare(terms, theta, np.arange(2)), *np.zeros((2, 3, terms.n + 1))
    psi, expected = np.zeros((N, 2)), np.zeros(N)
    for k in range(N):
        travel(prepared, X, moved, u[k, 0])
        X, moved = moved, X
        psi[k], expected[k] = X[1:, -1], X[0, -1]
    y = expected + 0.1 * rng.standard_normal(N)
    prior, drift, before = np.diag([4.0, 9.0]), np.diag([1e-3, 0.0]), np.array([0.9, 1.0])
    start = np.zeros((3, terms.n + 1))
    start[0, :-1] = x
    found = replay(
        terms, theta, start, prior, prior, (u, y, np.ones(N, bool)), forgetting=1.0,
        drift=drift, before=before, box=(-np.full(2, 1e9), np.full(2, 1e9)),
    )  # fmt: skip
    estimate, P = before.copy(), prior  # a Kalman filter for a random walk, unit noise
    for k in range(N):
        P = P + drift
        gain = P @ psi[k] / (1 + psi[k] @ P @ psi[k])
        estimate = estimate + gain * (y[k] - expected[k] - psi[k] @ (estimate - theta))
        P = P - np.outer(gain, psi[k] @ P)
    np.testing.assert_allclose(found.theta[-2], estimate, rtol=1e-9)
    np.testing.assert_allclose(found.P[-2], P, rtol=1e-9)


def test_a_question_is_answered_by_the_ratio_of_the_evidence():
    # linear regression, for which the evidence has a closed form
    rng = np.random.default_rng(2)
    A, mean, deviation = rng.standard_normal((30, 3)), np.array([0.2, 1.0, 0.0]), np.ones(3)
    y = A @ [0.5, 1.05, 0.0] + 0.3 * rng.standard_normal(30)

    def evidence(free):
        """Logarithm of the normal density of y, its parameters integrated out."""
        cov = 0.09 * np.eye(30) + A[:, free] @ A[:, free].T
        told = A @ np.where(np.isin(np.arange(3), free), mean, [0.0, 1.0, 0.0])
        return -((y - told) @ np.linalg.solve(cov, y - told) + np.linalg.slogdet(cov)[1]) / 2

    H = A.T @ A / 0.09 + np.eye(3)
    theta = np.linalg.solve(H, A.T @ y / 0.09 + mean)
    posterior, asked = Posterior(np.arange(3), theta, H), []
    for i, told in enumerate((0.0, 1.0, 0.0)):
        others = [j for j in range(3) if j != i]
        asked.append(evidence(others) - evidence([0, 1, 2]))
        question = Question(np.array([i]), np.array([told]), np.array([], int))
        found = weight(posterior, question, mean[[i]], deviation[[i]])
        assert found == pytest.approx(asked[i], rel=1e-9)
        left, _ = needed(posterior, [question], mean=mean, deviation=deviation)
        assert (i in left.active) == (asked[i] < -TRUST)
    assert asked[0] < -TRUST < asked[1]  # one of each kind at least
    left, fixed = needed(
        posterior, [Question(np.array([2]), np.zeros(1), np.array([], int))],
        mean=mean, deviation=deviation,
    )  # fmt: skip
    few = A[:, :2]
    again = np.linalg.solve(few.T @ few / 0.09 + np.eye(2), few.T @ y / 0.09 + mean[:2])
    np.testing.assert_allclose(left.theta, again)
    assert [places.tolist() for places, _ in fixed] == [[2]]


def test_a_torque_that_depends_on_the_angle_follows_the_measured_one():
    no_friction = LAW | {"f_c": 1e-9, "f_s": 0.0, "sigma_1": 0.0}
    nominal = (
        N1 | no_friction | {"kappa": 0.0, "gap": 0.0, "poles": 24.0, "c_sin": 0.1, "c_cos": 0.0}
    )
    model = real_axis(nominal).parametrize(["k_T", "c_sin"])
    row, terms = angle_of(model), planned(model, 0.5 * model.theta, 2 * model.theta, T)
    assert row == 5

    def after(c_sin):
        theta = np.array([1.0, c_sin])
        prepared, X, moved = prepare(terms, theta, np.arange(2)), *np.zeros((2, 3, terms.n + 1))
        X[:, row] = 7.0  # what the model made of it, and of its derivatives
        follow(prepared, X, moved, np.array([0.0, np.pi / 48]))
        return moved

    # at rest the torque is c_sin sin(24 φ) = c_sin
    accelerated = 0.1 * T / N1["J_m"]
    assert after(0.1)[0, 2] == pytest.approx(accelerated, rel=0.3)  # less gear and friction
    slope = (after(0.1 + 1e-4)[0, 2] - after(0.1 - 1e-4)[0, 2]) / 2e-4
    assert after(0.1)[2, 2] == pytest.approx(slope, rel=1e-4)
    assert after(0.1)[0, row] == pytest.approx(np.pi / 48, abs=accelerated * T)


@pytest.mark.parametrize("output", ["speed", "increment"])
@pytest.mark.slow
def test_the_measured_angle_is_the_sum_of_what_was_measured(output):
    nominal = N1 | {"poles": 24.0}
    filter_ = relocate_friction(nominal, T, output=output, P0=[1e-4, 1e-4, 1e-6])
    y = np.random.default_rng(3).standard_normal(40)
    filter_.run(np.zeros(40), y)
    angle = filter_._judge.memory.read("u", 0)[:, 1]
    means = y[1:] if output == "increment" else (y[1:] + y[:-1]) / 2
    np.testing.assert_allclose(angle, T * np.r_[0.0, np.cumsum(means)], atol=1e-12)


def test_the_interval_of_a_ratio_holds_it_in_95_of_100():
    rng = np.random.default_rng(4)
    after, before = 1.5 + 0.02 * rng.standard_normal(4000), 1.0 + 0.01 * rng.standard_normal(4000)
    inside = [
        low <= 1.5 <= high
        for low, high in (
            interval_of(a, b, (4e-4, 1e-4)) for a, b in zip(after, before, strict=True)
        )
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)  # four deviations of 4000 draws


def rubbing(multisine, by_hand, seconds, at, factor):
    """u and noisy speed of the axis with LuGre friction, f_m changed at a time: RK4, fine steps."""
    rng, N, h = np.random.default_rng(5), round(seconds / T), T / 40  # stable to 22 rad/s
    reference, f_m = multisine(rng, N), N1["f_m"]
    axes = [by_hand(dict(N1) | {"f_m": value}) for value in (f_m, factor * f_m)]
    x, z, lowpass, integral, last = np.zeros(6), 0.0, 0.0, 0.0, 0.0
    u, speed, smooth = np.zeros(N), np.zeros(N), np.exp(-T / 0.0005)
    for k in range(N):
        speed[k], error = x[2], reference[k] - x[5]
        lowpass = smooth * lowpass + (1 - smooth) * (error - last) / T
        last, s = error, 4.0 * error + lowpass
        integral += T * 2.0 * s
        u[k] = 0.22 * (s + integral)
        A, B = axes[k * T >= at]

        def slope(state, torque=u[k], A=A, B=B):
            v, z = state[2], state[6]
            level = LAW["f_c"] + LAW["f_s"] * np.exp(-((v / LAW["v_s"]) ** 2))
            dz = v - LAW["sigma_0"] * abs(v) * z / level
            pull = LAW["sigma_0"] * z + LAW["sigma_1"] * dz
            moved = A @ state[:6] + B * torque
            moved[2] -= pull / N1["J_m"]
            return np.r_[moved, dz]

        state = np.r_[x, z]
        for _ in range(40):
            a = slope(state)
            b = slope(state + h / 2 * a)
            c = slope(state + h / 2 * b)
            d = slope(state + h * c)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
        x, z = state[:6], state[6]
    return u, speed + 0.1 * rng.standard_normal(N)


@pytest.mark.slow
def test_a_fault_of_viscous_friction_is_told_from_dry_friction(by_hand):
    from conftest import multisine

    u, y = rubbing(multisine, by_hand, 9.0, 7.0, 1.5)
    filter_ = relocate_friction(N1, T, P0=[1e-4, 1e-4, 1e-6])
    theta = filter_.run(u, y) / [1.0, 1.25, 0.05, 0.1]
    (finding,) = filter_.findings
    assert filter_.names == ("k_T", "1/J_a", "f_m", "f_c")
    assert finding.parameters == ("f_m",) and abs(finding.onset - 1400) <= 10
    ((low, high),) = finding.interval
    assert low < 1.5 < high < low + 0.1
    before, after = theta[1200:1400].mean(axis=0), theta[-1]
    assert (abs(before - 1) < [0.01, 0.01, 0.02, 0.04]).all()  # four deviations of 5 s of data
    assert (abs(after - [1, 1, 1.5, 1]) < [0.01, 0.01, 0.03, 0.06]).all()


MOVED = {"torque": 1e3, "angle": 180 / np.pi}  # to mN m and degrees


def other_units(q):
    """The axis q in mN m and degrees: all but ratios are torques by angles, or their rates."""
    ratio = MOVED["torque"] / MOVED["angle"]
    return {name: value * (1.0 if name in {"k_T", "r"} else ratio) for name, value in q.items()}


@pytest.mark.slow
def test_estimates_do_not_depend_on_units(by_hand):
    from conftest import multisine

    u, y = rubbing(multisine, by_hand, 5.5, 4.0, 1.5)  # two fits, a fault, a rewind
    here = relocate_friction(N1, T)
    there = relocate_friction(other_units(N1), T)
    expected = here.run(u, y)
    found = there.run(MOVED["torque"] * u, MOVED["angle"] * y)
    ratio = MOVED["torque"] / MOVED["angle"]
    np.testing.assert_allclose(
        found / [1.0, 1 / ratio, ratio, MOVED["torque"]], expected, rtol=1e-6, atol=1e-9
    )
    assert len(here.findings) == 1
    for mine, other in zip(here.findings, there.findings, strict=True):
        assert (mine.alarm, mine.onset, mine.parameters) == (
            other.alarm, other.onset, other.parameters,
        )  # fmt: skip


def test_no_law_acts_before_a_motion_is_measured():
    filter_ = relocate_friction(N1, T)
    u, y = np.sin(np.arange(150) / 9), np.random.default_rng(6).standard_normal(150)
    theta = filter_.run(u, y)
    assert (theta[:, 3] < 1e-9 * abs(u).max()).all()
    bristles = filter_._judge.memory.stretch(0).x[:, 5]
    assert (abs(bristles) < 1e-9 * abs(u).max()).all()


def test_a_law_that_is_identified_is_tracked_behind_the_others():
    P0 = np.diag([1e-4, 1e-2, 1e-4, 1e-6])
    filter_ = relocate_friction(N1, T, identify=("k_T", "f_c", "1/J_a", "f_m"), P0=P0)
    assert filter_.names == ("k_T", "1/J_a", "f_m", "f_c")
    np.testing.assert_allclose(np.diag(filter_._design.P0)[:4], [1e-4, 1e-4 / 1.25**2, 4e-4, 0])
    with pytest.raises(EstimatorError, match=r"cannot track 'poles'; of laws it can track f_c"):
        relocate_friction(N1 | {"poles": 24.0}, T, identify=("k_T", "poles"))


@pytest.mark.parametrize("name", ["f_m", "d_g"])
def test_what_starts_at_zero_cannot_be_identified(name):
    with pytest.raises(EstimatorError, match=f"^{name} = 0 gives its changes no scale: give the"):
        relocate_friction(N1 | {name: 0.0}, T, identify=("k_T", name))


@pytest.mark.slow
def test_told_what_is_far_from_true_it_stays_finite_and_says_that_it_is_lost(by_hand):
    from conftest import multisine

    u, y = rubbing(multisine, by_hand, 5.0, 9.0, 1.0)
    for wrong in ({"J_m": 8 * N1["J_m"]}, {"J_m": 0.25 * N1["J_m"]}, {"k_g": 2 * N1["k_g"]}):
        filter_ = relocate_friction(N1 | wrong, T)
        assert np.isfinite(filter_.run(u, y)).all()
        assert filter_._judge.memory.state["noise"] < np.var(y)  # what diverged is no noise
        lost = [finding for finding in filter_.findings if finding.reason == LOST]
        assert 1 <= len(lost) <= 4  # at most one for each fit and one of the search


def turned(step):
    """Sine and cosine of cogging, 0.3 and 0.4, and by how much the angle turned, after a step."""
    tuning = {"phase": np.arange(2), "factors": np.ones(2), "poles": 24.0}
    theta, moved = np.array([0.3, 0.4]) + step, np.array(step)
    state = {"theta": theta, "moved": moved, "angle": 7.0, "turned": 0.0}
    turn.function(tuning, state)
    assert state["angle"] == 7.0 + state["turned"]
    return theta, state["turned"]


def test_a_phase_that_wanders_turns_the_angle_and_leaves_the_amplitude():
    theta, angle = turned([-0.04, 0.03])  # along the circle of radius 0.5, by 0.1 rad
    np.testing.assert_allclose(theta, [0.3, 0.4], rtol=1e-12)
    phase = np.arctan2(0.4, 0.3)
    after = 0.5 * np.sin(24 * angle + phase)  # at the angle 0
    assert after == pytest.approx(0.43, abs=0.5 * 0.1**2)  # of second order
    theta, angle = turned([0.03, 0.04])  # outwards
    np.testing.assert_allclose(theta, [0.33, 0.44], rtol=1e-12)
    assert angle == pytest.approx(0.0, abs=1e-15)
