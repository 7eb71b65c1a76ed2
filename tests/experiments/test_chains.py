"""An axis of two masses from scenario to score; and one of which there is no model."""

import numpy as np
import pytest

from flexaxis.estimators.models.axis_models import MODELS
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.models_mjcf import MODEL_NAMES
from flexaxis.sim.parameters import preset
from tests.sim.motion import linearised


def chain():
    return find_scenario("two_mass_fm_step-v1")


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_the_estimators_model_is_the_plant(name):
    """Of every folder beside these, too: a plant comes with its model, or it is refused."""
    rng = np.random.default_rng(1)
    for _ in range(3):
        q = preset("n1", name)
        q = q.replace(**{key: value * rng.uniform(0.5, 1.0) for key, value in q.items()})
        A, B, C = MODELS[name].factory(q).parametrize(["k_T"]).matrices([q.k_T])
        wanted, push = linearised(q, name)
        scale = np.abs(wanted).max(axis=1, keepdims=True)
        assert np.max(np.abs(A - wanted) / scale) < 1e-12
        assert np.max(np.abs(B[:, 0] - push)) < 1e-12 * np.abs(push).max()
        assert np.array_equal(C.ravel(), np.eye(len(A))[len(A) // 2])  # the motor's speed


@pytest.fixture(params=["no model of its name", "a model of other parameters"])
def unknown(request, monkeypatch):
    """A plant that estimators have no model of."""
    monkeypatch.delitem(MODELS, "two_mass")
    if request.param != "no model of its name":
        monkeypatch.setitem(MODELS, "two_mass", MODELS["one_mass"])

    def never(*_, **__):
        raise AssertionError("it was simulated")

    for place in ("experiments.running.cache", "experiments.scoring.nominal_torque"):
        monkeypatch.setattr(f"flexaxis.{place}.simulate", never)
    return chain()


TOLD = "two_mass_fm_step-v1: estimators have no model two_mass with the parameters k_T, J_m, J_l,"


@pytest.mark.parametrize("estimator", ["rpem-forgetting", "frozen", "pipe:true"])
def test_without_a_model_nothing_is_run(unknown, estimator, tmp_path, capsys):
    words = ["run", unknown.name, "--estimator", estimator, "--seeds", "1"]
    assert main([*words, "-o", str(tmp_path / "run")]) == 2
    assert TOLD in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
