"""What is carried from sample to sample: no more than is in use, and with the same result."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.models.axes import N1, real_axis
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.recursion.design import make_design
from flexaxis.estimators.relocate.choices import choices
from flexaxis.estimators.relocate.entry import relocate_friction
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.held import held, rows_with
from flexaxis.estimators.relocate.suspects import widened

T = 0.005
NAMES = ("k_T", "1/J_a", "f_m")
SUSPECTS = ("J_m", "J_g", "k_g", "k_a", "d_g", "d_a", "f_g", "f_a")
P0 = known_P(NAMES, forgetting=0.995)
LAWS = {
    "f_c": 0.1, "f_s": 0.05, "v_s": 0.5, "sigma_0": 100.0, "sigma_1": 0.3, "v_0": 0.1,
    "kappa": 10.0, "gap": 1e-4,
}  # fmt: skip
COGGING = {"c_sin": 0.1, "c_cos": 0.0, "poles": 24.0}


def lanes(filter_):
    """How many lanes a sample takes, and how many parameters are carried along."""
    memory = filter_._judge.memory
    return memory._states["X"].shape[-1], len(memory.carried)


def test_a_suspect_is_carried_only_while_it_is_estimated(nominal, simulated):
    run = simulated(12.0, seed=3, faults={6.0: dict(nominal) | {"k_g": 0.8 * nominal["k_g"]}})
    filter_ = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T)
    filter_.run(run.u[:1199], run.y[:1199])
    assert lanes(filter_) == (4, 3)  # one register: a value and three derivatives
    row = filter_._judge.memory._ring.words.shape[1]
    filter_.run(run.u[1199:1500], run.y[1199:1500])
    assert lanes(filter_) == (12, 11)
    filter_.run(run.u[1500:], run.y[1500:])
    assert lanes(filter_) == (4, 3)
    assert [finding.parameters for finding in filter_.findings] == [("k_g",)]
    # what was remembered of eleven is forgotten, and its room given back at the next change
    memory = filter_._judge.memory
    now = memory._carried.packed({name: memory.state[name][None] for name in ROW})
    memory._go_on(memory._carried, now[0], memory.state["theta"], memory.count)
    assert memory._ring.words.shape[1] > row
    filter_.run(run.u[:1100], np.zeros(1100), np.zeros(1100, bool))
    now = memory._carried.packed({name: memory.state[name][None] for name in ROW})
    memory._go_on(memory._carried, now[0], memory.state["theta"], memory.count)
    assert memory._ring.words.shape[1] == row < 100


ROW = ("theta", "P", "claim", "X", "psi")


@pytest.mark.parametrize("name", ["f_m", "k_g"])
def test_the_result_does_not_depend_on_what_is_carried(nominal, simulated, name):
    run = simulated(10.0, seed=5, faults={6.0: dict(nominal) | {name: 0.7 * nominal[name]}})
    filter_ = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T)
    narrow, found = filter_.run(run.u, run.y), filter_.findings
    covariance = filter_.covariance
    filter_._judge.memory._choices = filter_._judge.memory._choices[-1:]
    filter_.reset()
    filter_.run(run.u[:1], run.y[:1])
    assert lanes(filter_) == (12, 11)
    filter_.reset()
    np.testing.assert_allclose(narrow, filter_.run(run.u, run.y), rtol=1e-12)
    np.testing.assert_allclose(covariance, filter_.covariance, rtol=1e-9, atol=1e-15)
    assert [(f.alarm, f.onset, f.parameters) for f in found] == [
        (f.alarm, f.onset, f.parameters) for f in filter_.findings
    ]


BRISTLES = ["f_s", "v_s", "sigma_0", "sigma_1", "v_0"]


def of_a_real_axis(**more):
    """Design, roles and choices of an axis with laws; of each its parameters and laws."""
    model = real_axis(dict(N1) | LAWS | more)
    narrow = make_design(model, identify=NAMES, theta0=None, P0=P0, period=T)
    learn = [*BRISTLES, "k_g", "kappa", "gap", *(("c_sin", "c_cos") if more else ())]
    design, roles = widened(
        narrow, model, track=["f_c"], learn=learn, told=(), suspects=("J_m", "J_g")
    )
    found = choices(design, roles)
    names = design.model.names
    return design, roles, [([names[i] for i in choice.places], choice.laws) for choice in found]


def test_a_law_that_does_nothing_is_not_carried():
    design, roles, (linear, rubbing, everything) = of_a_real_axis()
    assert linear == (list(NAMES), ())
    assert rubbing == ([*NAMES, "f_c", *BRISTLES], (0,))
    assert everything == (list(design.model.names), (0, 1))
    absent = choices(design, roles)[0].absent
    assert {design.model.names[i] for i in absent} == {"f_c", "f_s", "kappa", "gap"}


def test_a_real_axis_begins_as_a_linear_one():
    filter_ = relocate_friction(N1, T)
    assert lanes(filter_) == (4, 3)  # before anything is known of friction
    axis, theta = filter_._judge.memory._choices[0], filter_._design.theta0.copy()
    used = np.zeros(len(theta), bool)
    used[:3] = True
    assert axis.has(theta, used)
    theta[filter_._design.model.names.index("kappa")] = 0.1
    assert not axis.has(theta, used)


def test_cogging_alone_is_carried_alone_and_a_limit_always():
    _, _, (linear, rubbing, cogging, _) = of_a_real_axis(**COGGING, torque_limit=3.0)
    assert linear == (list(NAMES), (3,))
    assert rubbing == ([*NAMES, "f_c", *BRISTLES], (0, 3))
    assert cogging == ([*NAMES, "c_sin", "c_cos"], (2, 3))


@pytest.mark.parametrize("gone", [(), (0,), (1,), (2,), (0, 1), (0, 1, 2)])
def test_a_held_model_is_the_model_at_those_values(gone):
    nominal = N1 | LAWS | COGGING
    model = real_axis(nominal).parametrize(["k_T", "f_m", "f_c", "k_g", "kappa", "J_m", "c_sin"])
    theta = model.theta * np.linspace(0.8, 1.3, len(model.theta))
    laws = tuple(i for i in range(3) if i not in gone)
    mine = np.array([i for i in (0, 2, 3, 6) if model.names[i] in dropped_to(laws)])
    few, rows = held(model, theta, mine, laws), rows_with(model, laws)
    assert few.names == tuple(model.names[i] for i in mine) and few.forces == len(laws)
    at = few.blocks(theta[mine])
    every = model.blocks(theta)[np.r_[0, 1 + mine]]
    np.testing.assert_allclose(at, every[:, rows[:, None], rows], rtol=1e-14)
    assert few.states == model.states - (0 in gone)
    if not laws:
        assert few.laws is None
        return
    for i, law in enumerate(laws):
        for r in range(model.laws.value.shape[1]):
            j = model.laws.parameter[law, r]
            value = model.laws.value[law, r] * (theta[j] if j >= 0 else 1.0)
            k = few.laws.parameter[i, r]
            assert k == (list(mine).index(j) if j in mine else -1)
            assert few.laws.value[i, r] * (theta[mine][k] if k >= 0 else 1.0) == pytest.approx(
                value
            )
        assert few.laws.kind[i] == model.laws.kind[law]
        inputs = np.r_[rows[rows < model.states], model.states]
        np.testing.assert_array_equal(few.laws.drive[i], model.laws.drive[law][inputs])
        own = model.laws.memory[law]
        assert few.laws.memory[i] == (list(rows).index(own) if own >= 0 else -1)


def dropped_to(laws):
    """Names that may be carried while these laws act."""
    own = {0: ("f_c",), 1: ("kappa",), 2: ("c_sin",)}
    return {"k_T", "k_g", *(name for law in laws for name in own[law])}


def test_the_past_is_told_of_all_parameters_whatever_was_carried(nominal, simulated):
    run = simulated(8.0, seed=3, faults={6.0: dict(nominal) | {"k_g": 0.8 * nominal["k_g"]}})
    filter_ = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T)
    filter_.run(run.u[:1199], run.y[:1199])
    before = filter_._judge.memory.stretch(1100).rows.copy()
    filter_.run(run.u[1199:], run.y[1199:])
    i, rows = filter_._design.model.names.index("k_g"), filter_._judge.memory.stretch(1100).rows
    (finding,) = filter_.findings
    since = finding.onset + 1 - 1100
    assert 90 < since < 110
    np.testing.assert_array_equal(rows[: min(since, 99)], before[: min(since, 99)])
    assert (rows["theta"][:since, i] == 1).all() and not rows["P"][:since, i].any()
    assert (rows["theta"][since:, i] < 0.95).all() and (rows["P"][since:, i, i] > 0).all()
    np.testing.assert_allclose(rows["psi"][-1], rows["X"][-1, -1, 1:], rtol=1e-12)
    parts = filter_._judge.memory._ring.parts(1100, 1600)
    assert [len(era.carried.places) for era, *_ in parts] == [3, 11]
