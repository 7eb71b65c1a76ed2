"""What is thought of friction, play and cogging beforehand: sizes, whatever the units."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import BRISTLES, N1, three_mass
from flexaxis.estimators.offline.roles import known_better
from flexaxis.estimators.offline.sizes import NOMINAL, Motion, motion, moved
from flexaxis.estimators.offline.structure import (
    TRACKED,
    guessed,
    prior,
    structure_names,
    with_laws,
)

PERIOD = 0.005
RNG = np.random.default_rng(0)
TORQUE = np.convolve(RNG.normal(size=8000), np.ones(4) / 2, "same")
TORQUE *= 0.85 / TORQUE.std()


def in_other_units(nominal, torque_unit):
    """Return N1 with torques, inertias, springs and dampings in another unit; k_T has none."""
    kept = {"k_T", "r"}
    return {n: v if n in kept else v * torque_unit for n, v in nominal.items()}


def test_a_prior_has_the_units_of_the_axis():
    names = (*TRACKED, *structure_names(with_laws(N1, torque=TORQUE, period=PERIOD)))
    here = prior(with_laws(N1, torque=TORQUE, period=PERIOD), names, torque=TORQUE, period=PERIOD)
    scaled = with_laws(in_other_units(N1, 100.0), torque=100 * TORQUE, period=PERIOD)
    there = prior(scaled, names, torque=100 * TORQUE, period=PERIOD)
    torques = {"f_m", "f_c", "f_s", "sigma_0", "sigma_1", "k_g", "J_m", "k_a", "d_g", "d_a"}
    unit = np.array([100.0 if n in torques else 0.01 if n == "1/J_a" else 1.0 for n in names])
    for field in ("start", "deviation", "lower", "upper", "scale"):
        np.testing.assert_allclose(getattr(here, field) * unit, getattr(there, field), rtol=1e-9)


def test_the_box_holds_the_start_and_the_scale_is_not_zero():
    model = with_laws(N1 | {"poles": 24.0}, torque=TORQUE, period=PERIOD)
    names = (*TRACKED, *structure_names(model))
    assert {"c_sin", "kappa", "gap", "sigma_0"} <= set(names)
    assert "poles" not in names
    made = prior(model, names, torque=TORQUE, period=PERIOD)
    assert np.all((made.lower <= made.start) & (made.start <= made.upper))
    assert np.all(made.deviation > 0)
    assert np.all(made.scale != 0)


def test_the_stored_sizes_are_those_of_the_nominal_reference():
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.scoring.nominal import nominal_torque

    nominal = N1 | {"poles": 24.0, "torque_limit": 1.75}
    torque = nominal_torque(find_scenario("fm_step-v1"))
    measured = with_laws(nominal, torque=torque, period=PERIOD).nominal
    stored = with_laws(nominal, period=PERIOD)
    assert {law.kind for law in stored.laws} <= set(NOMINAL)
    assert measured == pytest.approx(stored.nominal, rel=0.02)


def test_sizes_of_a_measured_motion_are_about_those_of_the_model():
    model = replace(with_laws(N1, period=PERIOD), laws=(BRISTLES,))
    ((_, sizes),) = moved(model, Motion(torque=0.85, speed=5.0, angle=5.0 / 118))
    assert sizes.drive == pytest.approx(NOMINAL["bristle"].drive, rel=0.3)
    assert sizes.force == pytest.approx(NOMINAL["bristle"].force, rel=0.01)
    assert sizes.rate == pytest.approx(NOMINAL["bristle"].rate, rel=0.2)


def test_a_motion_is_measured_from_its_speed():
    t = PERIOD * np.arange(20_000)
    found = motion(2.0 * np.sin(10 * t), 3.0 * np.sin(10 * t), PERIOD)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(found, [2.0 * half, 3.0 * half, 0.3 * half], rtol=1e-3)


def test_a_measured_prior_has_the_units_of_the_axis():
    names = ("f_m", "f_c", "sigma_0", "v_s")
    found = []
    for torque in (1.0, 100.0):
        model = replace(with_laws(N1, period=PERIOD), laws=(BRISTLES,))
        model = replace(model, nominal=dict(model.nominal) | in_other_units(N1, torque))
        moves = Motion(0.85 * torque, 5.0, 0.04)
        model = guessed(model, tuple(N1), period=PERIOD, motion=moves)
        found.append(prior(model, names, period=PERIOD, motion=moves))
    unit = np.array([100.0, 100.0, 100.0, 1.0])
    for field in ("start", "deviation", "lower", "upper"):
        here, there = (getattr(one, field) for one in found)
        np.testing.assert_allclose(here * unit, there, rtol=1e-9)


def test_without_a_torque_only_the_nominal_axis_is_known():
    with pytest.raises(EstimatorError, match="give torque"):
        with_laws(N1 | {"k_g": 1e6}, period=PERIOD)
    with pytest.raises(EstimatorError, match="in which the axis moves"):
        with_laws(N1, torque=np.zeros(100), period=PERIOD)


def test_what_is_told_is_believed_more():
    model = with_laws(N1 | {"f_c": 0.1}, torque=TORQUE, period=PERIOD)
    open_, told = (
        prior(model, ["f_c"], torque=TORQUE, period=PERIOD, told=names) for names in ((), ("f_c",))
    )
    assert model.nominal["f_c"] == 0.1
    assert told.deviation[0] == pytest.approx(0.02)
    assert open_.deviation[0] > 0.05


def test_a_model_of_ones_own_is_kept():
    model = three_mass(N1)
    assert with_laws(model, period=PERIOD) is model
    assert structure_names(model) == ("k_g", "J_m", "k_a", "d_g", "d_a")


def test_a_deviation_of_an_inertia_is_one_of_its_inverse():
    model = three_mass(N1)
    thought = prior(model, ("f_m", "1/J_a"), period=PERIOD, torque=TORQUE)
    known = known_better(model, thought, {"J_a": 0.02, "f_m": 0.001})
    np.testing.assert_allclose(known.deviation, [0.001, 0.02 / 0.8**2])
    inverses = 1 / (0.8 + np.array([-0.02, 0.02]))
    assert known.deviation[1] == pytest.approx(-np.diff(inverses)[0] / 2, rel=0.01)
