"""Identity, random numbers and records of a scenario: what each of them depends on."""

import numpy as np
import pytest

from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.simulate import simulate

from .test_scenario import BARE, FAULT
from .test_simulate import identical

SHORT = (BARE + FAULT).replace("20.0", "2.0").replace("10.0", "1.0")
OLD = 'streams = "content"' + SHORT

# What the axis and its sensors do not see, and some of what they do.
TOLD = {
    "start": 1.2,
    "identify": ["k_T", "f_m"],
    "known": {"k_g": 1.1},
    "output": "increment",
    "burn_in": 0.5,
    "card": "other words",
}
SEEN = {
    "duration": 1.5,
    "fault[0].factor": 2.0,
    "noise.speed": 0.2,
    "encoder.counts": 2048,
    "controller.Kp": 5.0,
    "excitation.rms": 0.04,
    "parameters.k_g": 700.0,
}


def record(scenario):
    return simulate(scenario, [3])[0]


@pytest.mark.parametrize("key", TOLD)
def test_what_estimators_are_told_moves_no_record(key):
    before = parse_scenario(SHORT)
    after = before.override({key: TOLD[key]})
    assert (after.hash == before.hash) == (key == "card")
    assert after.key == before.key and after.record_hash == before.record_hash
    assert identical(record(after), record(before))


@pytest.mark.parametrize("key", SEEN)
def test_what_the_plant_sees_draws_other_numbers(key):
    before = parse_scenario(SHORT)
    after = before.override({key: SEEN[key]})
    ours, theirs = record(after), record(before)
    samples = slice(20, 100)  # before the fault; a torque of zero is the same for all
    assert len({before.hash, after.hash, before.key, after.key}) == 4
    assert after.record_hash != before.record_hash
    assert not np.isclose(ours.torque[samples], theirs.torque[samples]).all()


@pytest.mark.parametrize("key", [*SEEN, *TOLD])
def test_with_streams_of_the_content_every_value_counts(key):
    before = parse_scenario(OLD)
    after = before.override({key: (SEEN | TOLD)[key]})
    same = key == "card"
    assert (before.key, after.key) == (before.hash, after.hash)
    assert (after.key == before.key) == (after.record_hash == before.record_hash) == same


@pytest.mark.parametrize("text", [OLD, SHORT], ids=["content", "plant"])
def test_scenarios_that_inherit_share_excitation_and_noise(text):
    base = parse_scenario(text)
    sizes = [base.override({"fault[0].factor": f}, inherit=True) for f in (1.2, 1.5, 2.0)]
    first, same, last = map(record, sizes)
    assert {s.key for s in sizes} == {base.key} and len({s.record_hash for s in sizes}) == 3
    assert sizes[1].hash == base.hash and identical(same, record(base))  # nothing changed
    for name in ("torque", "speed", "true_speed"):
        before, after = getattr(first, name), getattr(last, name)
        assert np.array_equal(before[:201], after[:201])
        assert not np.array_equal(before, after)
    # the noise is added to another speed and taken off again: to within round-off
    noise = first.speed - first.true_speed
    np.testing.assert_allclose(noise, last.speed - last.true_speed, rtol=0, atol=1e-13)
    own = record(base.override({"fault[0].factor": 1.2}))
    assert not np.isclose(own.speed[20:], first.speed[20:]).any()
