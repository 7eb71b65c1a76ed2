"""What an excitation can see of an axis, against sensitivities by finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identification.visibility import visible
from flexaxis.sim.record import Record

T, J, F, NOISE = 1e-3, 0.01, 0.05, 0.02


def speed(u, inertia, friction):
    pole = np.exp(-friction * T / inertia)
    return lfilter([0, (1 - pole) / friction], [1, -pole], u)


def recorded(u, seed=0):
    y = speed(u, J, F) + NOISE * np.random.default_rng(seed).standard_normal(len(u))
    return Record(time=T * np.arange(len(u)), torque=u, speed=y)


def one_mass():
    return find_axis("one_mass").having({"k_T": 1.0, "J_m": J, "f_m": F})


def test_deviations_are_those_of_the_sensitivities():
    u = np.random.default_rng(1).standard_normal(40_000)
    h = 1e-4
    psi = np.stack(
        [
            (speed(u, J * (1 + h), F) - speed(u, J * (1 - h), F)) / (2 * h),
            (speed(u, J, F * (1 + h)) - speed(u, J, F * (1 - h))) / (2 * h),
        ],
        axis=1,
    )
    information = psi.T @ psi / NOISE**2
    alone, together = (
        1 / np.sqrt(np.diag(information)),
        np.sqrt(np.diag(np.linalg.inv(information))),
    )
    seen = visible(recorded(u), replace(one_mass(), known=True))
    for k, name in enumerate(("J_m", "f_m")):
        # spectra of forty pieces: 16 % of each line, a few per cent of their sum
        assert seen[name].alone == pytest.approx(alone[k], rel=0.15)
        assert seen[name].together == pytest.approx(together[k], rel=0.15)
    assert seen["J_m"].partner == "f_m"


def test_what_is_not_excited_is_not_seen():
    fast = np.diff(np.random.default_rng(2).standard_normal(20_003), 2)[:20_000] * 1e-3
    seen = visible(recorded(fast), replace(one_mass(), known=True))
    assert "NOT seen" in seen["f_m"].words


def test_two_frictions_cannot_be_told_apart_by_a_stiff_spring():
    axis = find_axis("two_mass").having(
        {"k_T": 1, "J_m": J / 2, "J_l": J / 2, "k": 1e4, "d": 0.1, "f_m": F / 2, "f_l": F / 2}
    )
    slow = lfilter([0.03], [1, -0.97], np.random.default_rng(3).standard_normal(20_000))
    seen = visible(recorded(slow), replace(axis, known=True))
    assert seen["f_m"].alone < 0.5 < seen["f_m"].together and seen["f_m"].partner == "f_l"
    assert "fix one of them" in seen["f_m"].words


def test_with_dry_friction_it_is_not_the_best(tmp_path):
    """σ has what friction does in it, which a model with its law will explain."""
    path = tmp_path / "axis.toml"
    path.write_text(
        f'model = "one_mass"\n[nominal]\nk_T = 1.0\nJ_m = {J}\nf_m = {F}\nf_c = 0.1\n'
        '[[law]]\nkind = "bristle"\ndrive = {speed_motor = 1.0}\nacts = {speed_motor = "-1/J_m"}\n'
        'parameters = {coulomb = "f_c", stiffness = 1e4}\n'
    )
    told = visible(recorded(np.random.default_rng(1).standard_normal(8000)), find_axis(str(path)))
    assert "dry friction is noise" in told["f_m"].words
    assert "reversals" in told["f_c"].words
