"""The plant as data: complete, named, annotated, and equal to the set it claims to be."""

import mujoco
import pytest

from flexaxis.models_mjcf import MODEL_NAMES, model_files


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
