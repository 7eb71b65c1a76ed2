"""Filters with a bank of hypotheses, on records of the catalogue."""

from functools import cache

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.nominal_torque import nominal_torque
from flexaxis.experiments.scoring.parameter_names import started_nominal
from flexaxis.sim.simulate import simulate

T = 0.005
glr = REGISTRY["glr"].factory


@cache
def drawn(name, seed=0):
    """A record of a scenario with what an estimator is told of it: its axis, and a torque."""
    scenario = find_scenario(name)
    return simulate(scenario, [seed])[0], dict(started_nominal(scenario)), nominal_torque(scenario)


def made(name, seed=0, **options):
    """The filter for a scenario."""
    _, nominal, torque = drawn(name, seed)
    return glr(nominal, T, torque=torque, **options)


def tracked(name, seed=0, until=None, **options):
    """A filter, its estimates and the record that it has gone through."""
    record, one = drawn(name, seed)[0], made(name, seed, **options)
    return one, one.run(record.torque[:until], record.speed[:until]), record
