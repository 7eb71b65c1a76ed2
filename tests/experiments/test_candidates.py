"""Three fits, one answer: judged by simulation of held-out pieces, on drives of known truth."""

from dataclasses import replace

import numpy as np
import pytest
from drives import RAIL, RAIL_COULOMB, Troubles, arm, loop, rail
from identify_axes import VALUES

from flexaxis.estimators.models.axes import BRISTLES
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identification.candidates import (
    INVERSE,
    WHITE,
    WHITENED,
    answer,
    better,
    candidates_of,
    deviations_of,
    errors_of,
    held_out,
    repeats,
    tried,
)
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.identification.log import log_of
from flexaxis.experiments.logs.identification.setup import Setup

TRUTH = RAIL | {"f_c": RAIL_COULOMB}


def setup_of(record, values):
    """Return a setup at a rail from values that are off."""
    axis = find_axis("one_mass")
    law = replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 1e9})
    model = replace(axis.model, laws=(law,), nominal={"k_T": 1.0} | values)
    return Setup(log_of(record, axis), model, ("J_m", "f_m", "f_c"))


@pytest.fixture(scope="module")
def candidates():
    """Of a drive on which a whitened fit takes ripple and hump for noise."""
    setup = setup_of(rail(1, 20.0), {"J_m": 90.0, "f_m": 180.0, "f_c": 15.0})
    z = setup.problem().start(np.array([90.0, 180.0, 15.0]), 0.0, setup.first())
    held = held_out(setup)
    return candidates_of(setup, tried(setup, z, held), held)


def test_where_the_model_lacks_something_whitened_errors_are_not_believed(candidates):
    assert {candidate.name for candidate in candidates} == {WHITE, WHITENED, INVERSE}
    best, deviations = answer(candidates)
    assert best.lacks and best.name != WHITENED
    assert best.error <= 1.5 * min(
        candidate.error for candidate in candidates if candidate.name != WHITENED
    )
    truth = np.array([TRUTH[name] for name in best.setup.names])
    assert np.all(abs(best.fitted.z[:3] - truth) < 3 * deviations[:3])


@pytest.mark.parametrize("lacks", [True, False])
def test_deviations_are_widened_to_what_fits_differ_by(candidates, lacks):
    (best,) = (candidate for candidate in candidates if candidate.name == WHITE)
    best = best if lacks else replace(best, errors=0 * best.errors + 1e-12)
    assert best.lacks is lacks
    np.testing.assert_array_equal(answer([best])[1], best.deviations)
    off = replace(best, name="another", fitted=replace(best.fitted, z=2 * best.fitted.z))
    # both simulate alike, so that either may be taken: off by as much as they differ, or half of it
    _, wider = answer([best, off])
    assert np.all(wider[:3] >= (0.5 if lacks else 0.99) * best.fitted.z[:3])


def test_errors_are_those_of_what_was_held_out(candidates):
    best = candidates[0]
    held = held_out(best.setup)
    residual = np.where(held, 3.0, 1.0)
    squares = errors_of(best.setup, replace(best.fitted, residual=residual), held)
    np.testing.assert_allclose(squares, 9.0)
    assert len(squares) == 30


@pytest.mark.parametrize(("periods", "factor"), [(1, 1.0), (2, np.sqrt(2)), (5, np.sqrt(5))])
def test_errors_that_repeat_tell_nothing_new(candidates, periods, factor):
    """N samples of a motion of P periods are as good as N/P."""
    white = np.tile(np.random.default_rng(periods).standard_normal(4000 // periods), periods)
    fitted = replace(candidates[0].fitted, white=white, good=np.ones(len(white), bool))
    assert repeats(fitted) == pytest.approx(factor, rel=0.05)
    gap = np.arange(len(white)) % 1000 > 50  # what is missing does not count
    assert repeats(replace(fitted, good=gap)) == pytest.approx(factor, rel=0.1)


def test_a_loop_is_no_surer_than_one_of_its_periods():
    """An encoder makes the same errors in each period of a periodic motion, of 10 s."""
    record = loop(1, 13, 0, 0)
    setup = Setup(
        log_of(record, find_axis("one_mass")), find_axis("one_mass").model, ("J_m", "f_m")
    )
    fitted = setup.solve(np.array([VALUES[1]["J_m"], VALUES[1]["f_m"]]))
    claimed = deviations_of(setup, fitted)[:2]
    assert np.all(claimed > 1.3 * fitted.deviations[:2])  # √2, once it goes in its circle


def test_better_is_beyond_chance_and_worth_it():
    rng = np.random.default_rng(0)
    before = 1 + 0.1 * rng.random(30)
    assert better(before, 0.9 * before) and not better(before, 0.999 * before)
    assert not better(before, before * (1 + rng.standard_normal(30)) ** 2 * 0.97)
    assert better(np.full(1, np.inf), before) and not better(before, np.full(1, np.inf))


def test_a_log_that_begins_in_motion_starts_from_the_measured_speed():
    record = rail(2, 20.0)
    moving = int(np.argmax(record.increment > 0.9 * record.increment.max()))
    sides = {n: getattr(record, n)[moving:] for n in ("time", "torque", "angle", "increment")}
    setup = setup_of(replace(record, **sides), {"J_m": 95.0, "f_m": 203.0, "f_c": 20.0})
    speed = sides["increment"][0]
    assert not setup.log.resting and setup.first()[0] == pytest.approx(speed, rel=0.05)
    problem = setup.problem()
    assert problem.lower[3] == 0.0 and np.isinf(problem.upper[3])  # on its side of the sign
    assert setup.solve(rounds=2).z[3] == pytest.approx(speed, rel=0.05)


@pytest.mark.slow
def test_a_hanging_arm_has_gravity_and_friction():
    found = identify(arm(0, seconds=10.0), find_axis("one_mass"))
    values = dict(zip(found.names, found.theta, strict=True))
    assert values["g_sin"] == pytest.approx(0.3, rel=0.01) and not found.warnings
    assert values["J_m"] == pytest.approx(0.01, rel=0.01)
    assert values["f_c"] == pytest.approx(0.1, rel=0.02)
    assert found.axis.beside["g_sin"] == values["g_sin"]


@pytest.mark.slow
@pytest.mark.parametrize("bits", [13, 18])
def test_a_loop_without_friction_gets_no_law_no_delay_and_keeps_what_was_stated(bits):
    found = identify(loop(1, bits, 0, 0), find_axis("one_mass"))
    assert found.friction == "none" and found.axis.torque_is is None and not found.warnings
    assert found.axis.delay < 0.02e-3
    truth = np.array([VALUES[1][name] for name in found.names])
    assert np.all(abs(found.theta - truth) < 4 * found.deviations)


@pytest.mark.slow
def test_a_drive_with_two_sides_of_friction():
    found = identify(rail(0, given=Troubles(sided=0.3)), find_axis("one_mass"))
    values = dict(zip(found.names, found.theta, strict=True))
    assert values["f_m"] == pytest.approx(RAIL["f_m"], rel=0.05) and not found.warnings
