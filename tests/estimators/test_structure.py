"""What is thought of friction, play and cogging beforehand: sizes, whatever the units."""

import numpy as np
import pytest

from flexaxis.estimators.models.axis_models import N1
from flexaxis.estimators.offline.structure import (
    NOMINAL,
    TRACKED,
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


def test_the_stored_sizes_are_those_of_the_nominal_reference():
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.scoring.nominal_torque import nominal_torque

    nominal = N1 | {"poles": 24.0, "torque_limit": 1.75}
    torque = nominal_torque(find_scenario("fm_step-v1"))
    measured = with_laws(nominal, torque=torque, period=PERIOD).nominal
    stored = with_laws(nominal, period=PERIOD)
    assert {law.kind for law in stored.laws} <= set(NOMINAL)
    assert measured == pytest.approx(stored.nominal, rel=0.02)
