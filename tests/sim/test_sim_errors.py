"""Errors: of one family, whole after a trip between processes, with the right hint."""

import pickle

import pytest

from flexaxis.sim import errors


@pytest.mark.parametrize(
    "error",
    [
        errors.ParameterError("J_m"),
        errors.RecordError("run.nc"),
        errors.ScenarioError("one", "two"),
        errors.SimulationError("failed", run=3, time=1.5, reason="warning"),
    ],
)
def test_errors_are_value_errors_and_travel_between_processes(error):
    assert isinstance(error, errors.FlexaxisError) and isinstance(error, ValueError)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == str(error)
    assert vars(again) == vars(error)


def test_hints_come_only_when_something_is_near():
    assert errors.did_you_mean("fault", ["default", "faults"]) == " Did you mean 'faults'?"
    assert errors.did_you_mean("K_T", ["k_T", "k_a"]) == " Did you mean 'k_T'?"
    assert errors.did_you_mean("zzz", ["k_T"]) == ""
