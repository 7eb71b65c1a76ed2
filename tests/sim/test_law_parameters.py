"""Parameters of the plant's laws: in scenarios, in records, and what changes them."""

import h5py
import numpy as np
import pytest

from flexaxis.sim.errors import RecordError
from flexaxis.sim.parameters import FIXED, LAW_NAMES, LAW_PARAMETERS, PARAMETER_NAMES
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.record import load_record
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.simulate import simulate

LUGRE = "lugre = { stiffness = 100.0, damping = 0.3, coulomb = 0.1, static = 0.15, stribeck = 0.5 }"
STATIC = "static_friction = { f_c = 0.2, f_s = 0.1, alpha = 3.0, beta = 8.0 }"
UNEVEN = (
    "load_friction = { f_c = 0.1, load = 0.1 }\n"
    "gear_friction = { f_c = 0.1, f_s = 0.1, motor = 0.1, external = 0.2, motor_slow = 0.1, "
    "external_slow = 0.1, v_s = 1.0, alpha = 2.0 }"
)
REST = "stiffening.gear = 2e4\nbacklash.gear = 2e-5\ncogging = { amplitude = 0.05, poles = 24 }\n"
STEP = '[[fault]]\nkind = "step"\nparameter = "{}"\nat = 1.0\nfactor = {}\n'


def made(*lines):
    return parse_scenario("\n".join(['name = "x"', "duration = 2.0", *lines]))


def test_each_law_has_its_parameters_by_name():
    scenario = made(LUGRE, REST)
    assert scenario.laws == {
        "f_c": 0.1, "f_s": pytest.approx(0.05), "v_s": 0.5, "sigma_0": 100.0, "sigma_1": 0.3,
        "kappa": 2e4, "gap": 2e-5,
    }  # fmt: skip
    assert scenario.parameter_names == (*PARAMETER_NAMES, *scenario.laws)
    assert list(scenario.laws) == [name for name in LAW_NAMES if name in scenario.laws]
    assert made(LUGRE, "friction.coulomb = 0.3").laws["f_c"] == 0.3  # the first has the name
    assert made("cogging = { amplitude = 0.05, poles = 24 }").laws == {} == made().laws


def test_every_table_says_what_is_declared_of_it():
    tables = made(LUGRE, REST, STATIC, UNEVEN, "friction.coulomb = 0.1").nonlinear
    declared = {key: tuple(table.law) for key, table in tables.items() if table.law}
    assert declared == dict(LAW_PARAMETERS) and list(declared) == list(LAW_PARAMETERS)
    assert {key for key in declared if not tables[key].kept(tables[key].law)} == set(FIXED.values())
    assert {name for names in LAW_PARAMETERS.values() for name in names} == set(LAW_NAMES)


def test_a_record_has_them_after_the_twelve_and_keeps_them(tmp_path):
    (record,) = simulate(made(LUGRE), [3])
    assert record.parameter_names == (*PARAMETER_NAMES, "f_c", "f_s", "v_s", "sigma_0", "sigma_1")
    path = record.save(tmp_path / "run.nc")
    again = load_record(path)
    assert again.parameter_names == record.parameter_names
    assert np.array_equal(again.true_parameters, record.true_parameters)
    with h5py.File(path, "r+") as file:  # readers go by name
        file["parameter"][:] = file["parameter"][:][::-1]
        file["true_parameters"][:] = file["true_parameters"][:][:, ::-1]
    assert np.array_equal(load_record(path).true_parameters, record.true_parameters)
    with h5py.File(path, "r+") as file:
        file["parameter"][0] = "sigma_7"
    with pytest.raises(
        RecordError, match=r"can also contain f_c, f_s, .*; the variable contains \['sigma_7'"
    ):
        load_record(path)


def test_a_fault_of_the_level_of_friction_acts_from_its_sample_on():
    scenario = made("friction.coulomb = 0.1", 'identify = ["f_m", "f_c"]', STEP.format("f_c", 2.0))
    (record,) = simulate(scenario, [0])
    level = record.true_parameters[:, record.parameter_names.index("f_c")]
    assert np.all(level[:200] == 0.1) and np.all(level[200:] == 0.2)
    nonlinear = list(scenario.nonlinear.values())
    plant = Plant([scenario.nominal], period=0.005, substeps=20, nonlinear=nonlinear)
    speed = []
    for k, torque in enumerate(record.torque):
        if k == 200:
            plant.set_law("f_c", 0.2)
        speed.append(plant.speed_m[0])
        plant.step(np.array([torque]))
    assert np.array_equal(record.true_speed, speed)
