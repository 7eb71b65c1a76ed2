"""The plant as data: complete, named, annotated, and equal to the set it claims to be."""

import mujoco
import numpy as np
import pytest

from flexaxis.models_mjcf import MODEL_NAMES, model_files
from flexaxis.sim.parameters import PARAMETER_UNITS, parameter_names, preset


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_model_and_its_scene_compile(name):
    xml, assets = model_files(name)
    plant = mujoco.MjModel.from_xml_string(xml, assets)
    scene = mujoco.MjModel.from_xml_string(assets["scene.xml"].decode(), assets)
    bodies = {plant.body(i).name for i in range(1, plant.nbody)}
    assert plant.nv == scene.nv == len(bodies)
    assert scene.ncam >= 1 and scene.nlight >= 1
    assert bodies <= {scene.body(scene.geom_bodyid[i]).name for i in range(scene.ngeom)}


def test_unknown_model_names_the_nearest():
    with pytest.raises(ValueError, match="Did you mean 'three_mass'"):
        model_files("three_masses")


@pytest.mark.parametrize(
    ("model", "name"), [(model, name) for model in MODEL_NAMES for name in parameter_names(model)]
)
def test_every_number_has_symbol_and_unit_beside_it_and_provenance(model, name):
    xml, assets = model_files(model)
    unit = PARAMETER_UNITS[name].replace("1", "no unit") if name == "r" else PARAMETER_UNITS[name]
    lines = [line for line in xml.splitlines() if "<!--" in line and f"{name} " in line]
    assert any(unit in line for line in lines), f"{name}: no comment with its unit {unit}"
    readme = assets["README.md"].decode()
    rows = [line.split("|") for line in readme.splitlines() if line.startswith(f"| {name} |")]
    assert len(rows) == 1
    stated = rows[0][2].strip()
    number = 1 / 118 if stated == "1/118" else float(stated)
    assert np.isclose(number, preset("n1", model)[name], rtol=1e-15)
