from functools import partial

import numpy as np
import pytest
from acceptance import literal as reference

from flexaxis.estimators import EstimatorError, registry, three_mass
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import (
    FOLLOWS,
    FOLLOWS_MEAN,
    default_drift,
    known_P,
    nominal_P,
    stored_P,
)
from flexaxis.estimators.protocol import Estimator

NAMES = ("k_T", "1/J_a", "f_m")


def test_defaults_are_plausible():
    """Forgetting factors are below one; the mean time constant is that of the parameters."""
    for entry in registry.REGISTRY.values():
        if entry.knob and entry.knob.startswith("1-"):
            assert 0.9 <= entry.default < 1.0, entry.name
    assert pytest.approx(np.exp(np.mean(np.log([*FOLLOWS.values()]))), rel=0.02) == FOLLOWS_MEAN


@pytest.mark.parametrize("name", registry.REGISTRY)
def test_every_entry_makes_an_estimator(nominal, name):
    entry = registry.REGISTRY[name]
    off = {**nominal, "f_m": 0.06}
    made = entry.factory(off, 0.005, identify=NAMES, output="speed", **entry.options)
    assert isinstance(made, Estimator)
    assert entry.name == name
    assert entry.turning is None or entry.turning.name in entry.options
    assert made.names[:3] == NAMES  # and what it tracks besides
    np.testing.assert_allclose(made.theta[:3], [1.0, 1.25, 0.06])  # θ(0) is what it was given


def test_initial_P_is_given_or_measured_or_known(nominal, loop):
    make = registry.REGISTRY["rpem-forgetting"].factory
    assert make(nominal, 0.005).P[0, 0] == pytest.approx(2.97e-4)
    assert make(nominal, 0.005, forgetting=0.99).P[0, 0] == pytest.approx(2 * 2.97e-4)
    assert make(nominal, 0.005, P0=[1e-3, 1e-3, 1e-3]).P[0, 0] == 1e-3
    swapped = make(nominal, 0.005, identify=("f_m", "k_T", "1/J_a"))
    np.testing.assert_allclose(np.diag(swapped.P), [4.69e-6, 2.97e-4, 5.19e-5])
    with pytest.raises(EstimatorError, match="specify P0 or the torque of a nominal run"):
        make(nominal, 0.005, identify=("k_a",))
    assert make(nominal, 0.005, identify=("k_a",), torque=loop.u[:4000]).P[0, 0] > 0


def test_a_smaller_P_leaves_its_limits_as_they_are(nominal):
    """With λ lowered while it runs, the demo took twice as long to track the next fault."""
    made = registry.REGISTRY["rpem-forgetting"].factory(nominal, 0.005)
    limits = list(made.state["granted"])
    made.P = made.P / 100
    assert list(made.state["granted"]) == limits


def test_the_paper_s_drift_is_that_of_its_axis_at_any_start(nominal):
    """Eq. (32) to the last bit; in other units or at another period the same relative to θ."""
    names = ("f_m", "1/J_a", "k_T")
    started = dict(nominal) | {"k_T": 1.2, "J_a": nominal["J_a"] / 1.2, "f_m": 0.06}
    for values in (nominal, started):
        drift = default_drift(three_mass(values), names, 0.005)
        assert drift.tolist() == [500e-8, 50e-8, 5e-8]
    drift = default_drift(three_mass(nominal), names, 0.01)
    np.testing.assert_allclose(drift, [4 * 500e-8, 4 * 50e-8, 4 * 5e-8], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "period", "identify", "known"),
    [
        ({}, 0.005, NAMES, True),
        ({"k_T": 1.2, "J_a": 0.8 / 1.2, "f_m": 0.06}, 0.005, ("f_m", "k_T", "1/J_a"), True),
        ({}, 0.002, NAMES, False),
        ({}, 0.005, ("k_T", "J_a", "f_m"), False),
        ({"k_a": 8.5e3}, 0.005, NAMES, False),
        ({"f_m": 50.0}, 0.005, NAMES, False),  # as in mN m s/rad
    ],
)
def test_stored_P_is_of_its_axis_alone(nominal, changes, period, identify, known):
    found = stored_P(three_mass(nominal | changes), identify, period, forgetting=0.995)
    assert (found is not None) == known
    make = registry.REGISTRY["rpem-forgetting"].factory
    if known:
        np.testing.assert_allclose(found, known_P(identify, forgetting=0.995))
    else:
        with pytest.raises(EstimatorError, match="specify P0 or the torque of a nominal run"):
            make(nominal | changes, period, identify=identify)


def test_unknown_names_are_answered(nominal):
    with pytest.raises(
        EstimatorError, match="unknown estimator 'rpem-drif': did you mean 'rpem-drift'"
    ):
        registry.REGISTRY["rpem-drif"]
    with pytest.raises(EstimatorError, match="scale is 0"):
        registry.REGISTRY["rpem-drift"].factory(nominal, 0.005, scale=0)


def test_a_memory_far_shorter_than_the_axis_s_own_is_said(nominal):
    """An axis that coasts for 13 s, and a method that forgets in one; not with a longer memory."""
    light = nominal | {"f_m": 1.3e-4, "f_g": 0.0, "f_a": 0.0}
    make = partial(registry.REGISTRY["rpem-forgetting"].factory, period=0.005, P0=np.eye(3))
    with pytest.warns(
        UserWarning, match=r"memory of 1 s .* time constant of 1[0-9]\.?[0-9]* s"
    ) as told:
        make(light)
    enough = float(str(told[0].message).split("forgetting=")[1].split()[0])
    make(light, forgetting=enough)
    make(nominal)


def test_recipe_gives_the_published_data(nominal, loop):
    model = three_mass(nominal)
    given = nominal_P(model, loop.u[:8000], period=0.005)
    np.testing.assert_allclose(given, known_P(NAMES, forgetting=0.995), rtol=0.03)
    given = nominal_P(model, loop.u[:8000], drift=[5e-8, 50e-8, 500e-8], period=0.005)
    np.testing.assert_allclose(given, known_P(NAMES, forgetting=None), rtol=0.03)
    with pytest.raises(EstimatorError, match=r"torque is \[\]; give the torque of a run"):
        nominal_P(model, [], period=0.005)


@pytest.mark.parametrize(
    "options", [{"regularization": 0.3}, {"drift": [5e-8, 50e-8, 500e-8]}, {"forgetting": 0.99}]
)
def test_recipe_is_the_paper_word_for_word(nominal, loop, options):
    model = three_mass(nominal).parametrize(NAMES)
    gradients, kept = predict(model, model.theta, loop.u[:401], period=0.005)[1], []
    Q, drift = np.mean(gradients**2, axis=0), np.array(options.get("drift", np.zeros(3)))
    forgotten = 1 - options.get("forgetting", 0.995)
    P = np.diag(np.sqrt(drift / Q) if "drift" in options else forgotten / Q)
    for psi in gradients:
        P = reference.measurement_update(P, psi)
        drift = np.diag(options.get("drift", np.zeros(3)))
        forgetting = 1.0 if "drift" in options else options.get("forgetting", 0.995)
        P = reference.time_update(P, forgetting, drift)
        P = reference.regularize(P, options.get("regularization", 0.0))
        kept.append(np.diag(P))
    given = nominal_P(three_mass(nominal), loop.u[:401], period=0.005, **options)
    np.testing.assert_allclose(given, np.mean(kept[200:], axis=0), rtol=1e-9)
