"""What the filter with a bank of hypotheses is told, learns once, and can be begun from."""

import numpy as np
import pytest
from acceptance.banks import T, drawn, glr, made

from flexaxis.estimators import EstimatorError

TRUTH = (1.0, 1.25, 0.05, 0.1)  # with the level of dry friction


def signals(name):
    record, *_ = drawn(name)
    return record.torque, record.speed


@pytest.mark.slow
def test_a_gap_and_a_start_in_motion_do_no_harm():
    u, y = signals("coulomb_fm_step-v1")
    valid = np.ones(len(u), bool)
    valid[1500:1560] = False
    part = slice(450, 2000)
    theta = made("coulomb_fm_step-v1").run(u[part], y[part], valid[part])
    error = theta[-200:].mean(axis=0) / TRUTH - 1
    assert np.all(np.abs(error) < [0.01, 0.005, 0.03, 0.05])


def test_what_is_not_seen_and_was_not_told_is_taken_as_absent():
    """A tenth of a motion, for a tenth of a second, shows nothing of it."""
    _, nominal, torque = drawn("fm_step-v1")
    estimator = glr(nominal | {"kappa": 1e3}, T, torque=torque, commissioning=0.1, noise=0.1)
    u, y = signals("fm_step-v1")
    estimator.run(0.1 * u[:400], 0.1 * y[:400])
    because = estimator.fixed_because
    assert because["kappa"].endswith("keeps its nominal value")
    assert because["J_m"].endswith("keeps its nominal value")
    assert because["gap"].endswith("assumed to be zero")
    value, deviation = estimator.learnt["kappa"]
    assert value == pytest.approx(1e3)
    assert deviation < 0.01 * value  # it walks as all structure does, by 3e-4 of its scale in √s
    assert np.abs(estimator.learnt["gap"]).max() < 1e-8  # rad


def test_a_told_zero_is_refused_by_its_name():
    _, nominal, torque = drawn("fm_step-v1")
    with pytest.raises(EstimatorError, match=r"^the nominal value of f_m is 0, .* remove"):
        glr(nominal | {"f_m": 0.0}, T, torque=torque)
