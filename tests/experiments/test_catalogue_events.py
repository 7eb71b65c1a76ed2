"""The events of the catalogue, against its files: a running product, in order of time."""

import pytest

from flexaxis.experiments.catalogue.find import find_scenario, scenario_names
from flexaxis.sim.tables.faults import CHANGEABLE

# a step while the same parameter warms up
OVERLAPPING = {
    "warming_fm_step-v1",
    "warming_fm_step-v2",
    "temperature_fm_step-v1",
    "temperature_fm_step-v2",
}


def settles(change):
    """Return when a change is over [s]."""
    match change.kind:
        case "ramp":
            return change.at + change.over
        case "thermal":
            return float("inf")
        case "intermittent":
            return change.until or float("inf")
    return change.at


def overlapping(scenario):
    changes = sorted((*scenario.fault, *(scenario.nuisance or ())), key=lambda change: change.at)
    return any(
        one.parameter == other.parameter and other.at < settles(one)
        for i, one in enumerate(changes)
        for other in changes[i + 1 :]
    )


def switches(fault, duration):
    """Yield time and factor of each change by a fault, from the words on it in the docs."""
    yield fault.at, fault.factor
    if fault.kind == "intermittent":
        time, on = fault.at, True
        while True:
            time += fault.on if on else fault.off
            if fault.until is not None and time >= fault.until:
                time = fault.until
            if time >= duration or (not on and time == fault.until):
                return
            on = not on
            yield time, fault.factor if on else 1 / fault.factor
            if time == fault.until:
                return


def by_hand(scenario):
    steps = [
        (round(time / scenario.period), CHANGEABLE.index(fault.parameter), fault.parameter, factor)
        for fault in scenario.fault
        for time, factor in switches(fault, scenario.duration)
    ]
    values, events = scenario.nominal.as_dict() | scenario.laws, []
    for index, _, name, factor in sorted(steps):
        events.append((name, index, values[name], values[name] * factor))
        values[name] *= factor
    return events


def test_which_overlap():
    found = {name for name in scenario_names() if overlapping(find_scenario(name))}
    assert found == OVERLAPPING


@pytest.mark.parametrize("name", sorted(set(scenario_names()) - OVERLAPPING))
def test_events_are_those_of_the_file(name):
    scenario = find_scenario(name)
    found = [(e.parameter, e.index, e.before, e.after) for e in scenario.events()]
    wanted = by_hand(scenario)
    assert [event[:2] for event in found] == [event[:2] for event in wanted]
    for event, other in zip(found, wanted, strict=True):
        assert event[2:] == pytest.approx(other[2:], rel=1e-14)  # roundings of the product


@pytest.mark.parametrize("name", sorted(OVERLAPPING))
def test_the_step_of_a_warm_axis(name):
    (event,) = find_scenario(name).events()
    assert event.after / event.before == pytest.approx(1.5, rel=1e-14)
