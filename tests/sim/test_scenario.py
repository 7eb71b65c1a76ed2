"""Scenarios: what a TOML means, its identity, and its truth over time."""

import numpy as np
import pytest

from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.tables.events import Event

BARE = """
name = "fm_step-v1"
duration = 20.0
"""
FAULT = """[[fault]]
kind = "step"
parameter = "f_m"
at = 10.0
factor = 1.5
"""
STEP = BARE + FAULT
FULL = """
name = "everything-v1"
card = '''Two lines, "quoted",
and a \\ backslash.'''
preset = "n2"
parameters.J_a = 2.0
duration = 30
identify = ["J_m", "1/k_g"]
start = 1.2
output = "increment"
burn_in = 2.5
feedback = "measured"
noise = { speed = 0.2, angle = 1e-5 }
encoder.counts = 65536
delay.measurement = 2
controller = { Kp = 5, Kv = 0.3, Ki = 1, tau = 0.001 }
[excitation]
kind = "multisine"
low = 0.5
high = 20
period = 4
rms = 0.03
pause = [[10, 12], [20, 20.5]]
[[fault]]
kind = "ramp"
parameter = "k_T"
at = 3
over = 2
factor = 0.9
[[fault]]
kind = "intermittent"
parameter = "J_a"
at = 7
on = 1
off = 2
factor = 1.1
until = 12
"""
K = PARAMETER_NAMES.index


@pytest.mark.parametrize("text", [STEP, FULL])
def test_toml_out_and_in_is_the_same_scenario(text):
    s = parse_scenario(text)
    again = parse_scenario(s.to_toml())
    assert again.resolved() == s.resolved() and again.hash == s.hash
    assert again.to_toml() == s.to_toml()
    assert parse_scenario(text) == s


def test_hash_pinned():
    """A change of these numbers is a change of every record's identity and random streams."""
    old = parse_scenario('streams = "content"' + STEP)
    assert (old.hash, old.key) == (PINNED, PINNED)
    new = parse_scenario(STEP)
    assert (new.hash, new.key) == (PINNED_NEW, PINNED_KEY)


PINNED_NEW = "89d7f0caa7e88965b1fba3f54abbec18838074a71205b41bbc191961b0dfb713"
PINNED_KEY = "a2d120ea5b235f9ae071ca3b7373315003bf13071567f55444d05fc25688ed9a"
PINNED = "4728e23aa5f4f74468f2682bcb7e2fe9b144cc2062cf0196e3c4cef2ba775db9"


@pytest.mark.parametrize(
    "same",
    [
        STEP.replace("fm_step-v1", "other"),
        STEP.replace("duration = 20.0", "duration = 20"),
        'card = "words"\npreset = "n1"\nstart = 1\nnoise.speed = 0.1' + STEP,
        "parameters.J_g = 7" + STEP,
    ],
)
def test_hash_sees_content_only(same):
    assert parse_scenario(same).hash == parse_scenario(STEP).hash


def test_true_parameters_are_nominal_times_factors():
    s = parse_scenario(FULL)
    truth, nominal = s.true_parameters(), np.array([*s.nominal.values()])
    assert truth.shape == (6000, 12)
    assert np.array_equal(truth[:600], np.tile(nominal, (600, 1)))
    assert truth[600, K("k_T")] < 1 and truth[1000, K("k_T")] == pytest.approx(0.9)
    J_a = truth[:, K("J_a")]
    assert J_a[1399] == 2.0 and np.all(J_a[1400:1600] == 2.2) and np.all(J_a[1600:2000] == 2.0)
    others = [k for k in range(12) if k not in (K("k_T"), K("J_a"))]
    assert np.array_equal(truth[:, others], np.tile(nominal[others], (6000, 1)))


def test_events_in_order_of_time():
    events = parse_scenario(FULL).events()
    assert [(e.parameter, e.index) for e in events] == [
        ("k_T", 600), ("J_a", 1400), ("J_a", 1600), ("J_a", 2000), ("J_a", 2200)
    ]  # fmt: skip
    assert events[0] == Event("k_T", 600, 1.0, 0.9)
    assert [e.after for e in events[1:]] == pytest.approx([2.2, 2.0, 2.2, 2.0])
    assert parse_scenario(STEP).events() == (Event("f_m", 2000, 0.05, 0.05 * 1.5),)


def test_faults_on_one_parameter_multiply():
    double = STEP + '[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 15\nfactor = 2\n'
    s = parse_scenario(double)
    assert s.true_parameters()[-1, K("f_m")] == pytest.approx(0.05 * 1.5 * 2)
    assert [(e.index, e.before, e.after) for e in s.events()] == [
        (2000, 0.05, pytest.approx(0.075)),
        (3000, pytest.approx(0.075), pytest.approx(0.15)),
    ]


def test_override_changes_value_name_and_hash_only():
    s = parse_scenario(STEP)
    t = s.override({"start": 1.2, "fault[0].factor": 2.0, "noise.speed": 0})
    assert (t.start, t.fault[0].factor, t.noise.speed) == (1.2, 2.0, 0)
    assert t.name == "fm_step-v1+start=1.2+fault[0].factor=2.0+noise.speed=0"
    back = t.override({"start": 1.0, "fault[0].factor": 1.5, "noise.speed": 0.1})
    assert back.hash == s.hash
    assert s.override({"excitation.rms": 0.02}).excitation.rms == 0.02
    assert s.override({"excitation": {"kind": "standstill"}}).excitation.kind == "standstill"
    assert s.override({"name": "mine", "start": 1.1}).name == "mine"


THERMAL = """
[[nuisance]]
kind = "thermal"
parameter = "f_m"
at = 5
time_constant = 4
factor = 0.6
"""


def test_a_nuisance_moves_the_truth_and_is_no_event():
    alone = parse_scenario(BARE + THERMAL)
    assert alone.events() == () and alone.hash != parse_scenario(STEP).hash
    f_m = alone.true_parameters()[:, K("f_m")]
    assert np.all(f_m[:1000] == 0.05) and np.all(np.diff(f_m[1000:]) < 0)
    # after three time constants e^-3 of the change is left, to within half a sample
    assert f_m[1000 + 2400] == pytest.approx(0.05 * (1 - 0.4 * (1 - np.exp(-3))), rel=1e-4)
    both = parse_scenario(STEP + THERMAL)
    assert both.true_parameters()[2500, K("f_m")] == pytest.approx(1.5 * f_m[2500])


@pytest.mark.parametrize(
    "text",
    ["friction.coulomb = 0.1", "backlash.gear = 1e-5", "stiffening.gear = 1e4", "known.k_g = 1.1",
     "saturation.torque = 1.0", "cogging = { amplitude = 0.1, poles = 6 }", "filter.speed = 0.001",
     "delay.torque = 0.001", "delay.measurement = 1", "controller.rate = 1000"],
)  # fmt: skip
def test_what_the_linear_model_does_not_describe(text):
    scenario = parse_scenario(text + STEP)
    assert not scenario.linear and parse_scenario(STEP).linear
    assert parse_scenario(scenario.to_toml()).hash == scenario.hash != parse_scenario(STEP).hash
