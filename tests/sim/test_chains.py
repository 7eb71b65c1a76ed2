"""The plant of two masses: its equations by hand, its MJCF, what tells models apart."""

import numpy as np
import pytest
from acceptance.axes import held

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.models_mjcf import MODEL_NAMES, SHIPPED, model_digest
from flexaxis.sim import identity
from flexaxis.sim.errors import ParameterError
from flexaxis.sim.parameters import AxisParameters, nominal_numbers, parameter_names, preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.record import load_record
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.simulate import simulate

T = 0.005


def two(q, x, u):
    """d/dt of (φ_m, φ_l, v_m, v_l)."""
    m, l, vm, vl = x  # noqa: E741
    shaft = q["k"] * (m - l) + q["d"] * (vm - vl)
    return [vm, vl, (q["k_T"] * u - q["f_m"] * vm - shaft) / q["J_m"],
            (shaft - q["f_l"] * vl) / q["J_l"]]  # fmt: skip


def moved(torque, truth):
    """Angles and speeds (N, 4) for a torque held from sample to sample, by matrix exponentials."""
    names, found, x, known = parameter_names("two_mass"), [], np.zeros(4), {}
    for u, theta in zip(torque, truth, strict=True):
        found.append(x)
        if theta.tobytes() not in known:
            q = dict(zip(names, theta, strict=True))
            A = np.column_stack([two(q, e, 0.0) for e in np.eye(4)])
            known[theta.tobytes()] = held(A, np.array(two(q, np.zeros(4), 1.0)), T)
        x = known[theta.tobytes()] @ np.append(x, u)
    return np.array(found)


def apart(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def test_a_plant_is_its_equations_to_the_order_of_the_integrator():
    """With every parameter changed on the way; a method of fourth order divides by 16."""
    rng = np.random.default_rng(0)
    before = np.array([*preset("n1", "two_mass").values()])
    after = before * np.exp(rng.normal(0, 0.2, len(before)))
    truth, torque = np.repeat([before, after], 100, axis=0), rng.normal(0, 1, 200)
    exact, errors = moved(torque, truth), []
    for substeps in (5, 10, 20):
        plant = Plant([preset("n1", "two_mass")], period=T, substeps=substeps, model="two_mass")
        angles = []
        for k, u in enumerate(torque):
            if k == 100:
                plant.set_parameters([after])
            angles.append(plant.angles[0].copy())
            plant.step(np.array([u]))
        errors.append(apart(np.array(angles), exact[:, :2]))
    assert errors[0] < 3e-4
    ratios = np.array(errors[:-1]) / errors[1:]
    assert np.all((ratios > 12) & (ratios < 20)), (errors, ratios)


def test_a_record_has_the_angle_of_each_mass_and_comes_back_from_its_file(tmp_path):
    changes = {"duration": 3.0, "fault[0].at": 1.5, "noise.speed": 0.0}
    record = simulate(find_scenario("two_mass_fm_step").override(changes), [0])[0]
    exact = moved(record.torque, record.true_parameters)
    for ours, wanted in zip(
        (record.true_angle_m, record.true_angle_l, record.speed), exact[:, :3].T, strict=True
    ):
        assert apart(ours, wanted) < 1e-3
    assert record.versions["mjcf"] == model_digest("two_mass")
    back = load_record(record.save(tmp_path / "run.nc"))
    assert back.parameter_names == record.parameter_names == parameter_names("two_mass")
    assert back.scenario["model"] == "two_mass"
    for mass in "mgal":
        ours, theirs = (getattr(each, f"true_angle_{mass}") for each in (record, back))
        assert (ours is None) == (mass not in "ml") and np.array_equal(ours, theirs)


def test_the_axis_of_the_paper_has_the_numbers_of_its_file():
    assert preset("n1") == nominal_numbers("three_mass")
    assert preset("n1").r == 1 / 118 and "r" not in preset("n1", "two_mass")
    assert parameter_names("two_mass") == ("k_T", "J_m", "J_l", "k", "d", "f_m", "f_l")


def test_parameters_are_those_of_one_model():
    with pytest.raises(ParameterError, match="no model has exactly the parameters k_T, J_m; the"):
        AxisParameters(k_T=1.0, J_m=1.0)
    with pytest.raises(ParameterError, match=r"'k_g'; known parameters are k_T, J_m, J_l"):
        preset("n1", "two_mass").replace(k_g=1.0)


SHORT = 'name = "s"\nduration = 2.0\n'


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_a_model_is_frozen_with_its_name(name):
    """Another MJCF is another model: a folder of its own, and a line of its own in `SHIPPED`."""
    assert SHIPPED.get(name) == model_digest(name)


def test_a_changed_mjcf_is_another_scenario_and_the_published_one_is_not(monkeypatch):
    text = SHORT + 'identify = ["k_T"]\n'
    plain = parse_scenario(text)
    before = {plain.hash, plain.key, plain.record_hash}
    of = {name: parse_scenario(f'{text}model = "{name}"') for name in MODEL_NAMES}
    assert of["three_mass"].hash == plain.hash and of["three_mass"].key == plain.key
    for every in ("hash", "key", "record_hash"):
        assert len({getattr(scenario, every) for scenario in of.values()}) == len(MODEL_NAMES)
    monkeypatch.setattr(identity, "model_digest", lambda _: "another MJCF")
    other = parse_scenario(text)
    assert not before & {other.hash, other.key, other.record_hash}
