"""Fail tests that use more than five seconds of CPU time, unless they are marked as longer.

A fast test should use at most one second; the limit is higher because timing on shared
machines is noisy.
"""

import os
import time

import hypothesis.internal.observability  # noqa: F401  pytest's plugin imports it in the first test
import matplotlib.pyplot  # noqa: F401
import pytest
from numba.core import event

import flexaxis as fx

LIMIT = 5.0  # [s] on the reference machine
REFERENCE = 0.1  # result of `additions` on the reference machine [s]
EXEMPT = {"slow", "browser", "whole"}
START, SHARED = pytest.StashKey[float](), pytest.StashKey[list]()
COMPILING = event.TimingListener()
event.register("numba:compiler_lock", COMPILING)  # held while code is compiled or loaded


def additions():
    """Return the CPU time [s] of 3 million additions, a measure of the machine's current speed."""
    start, total = time.process_time(), 0
    for i in range(3_000_000):
        total += i
    return time.process_time() - start


def used():
    """Return the CPU time [s] of this process and its children, without time spent in numba."""
    return sum(os.times()[:4]) - (COMPILING.duration if COMPILING.done else 0.0)


class SharedFixtures:
    """A plugin, because hooks of a conftest do not see fixtures of the session."""

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef, request):
        """Add the CPU time of shared fixtures to a separate sum, not to the first test."""
        start = used()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                request.config.stash[SHARED][0] += used() - start


def pytest_configure(config):
    """Initialise the CPU time of shared fixtures."""
    config.stash[SHARED] = [0.0]
    config.pluginmanager.register(SharedFixtures())


@pytest.fixture(scope="session", autouse=True)
def imported():
    """Import all names of flexaxis in advance, so that no test is charged for the imports."""
    for name in fx.__all__:
        getattr(fx, name)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item):
    """Store the CPU time at which a test starts."""
    item.stash[START] = used() - item.config.stash[SHARED][0]
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item):
    """Fail a test that took too long, measured in the speed of this machine."""
    result = yield
    seconds = used() - item.config.stash[SHARED][0] - item.stash[START]
    if seconds > LIMIT and not EXEMPT & item.keywords.keys():
        seconds *= REFERENCE / max(additions() for _ in range(5))
        if seconds > LIMIT:
            pytest.fail(f"{seconds:.1f} s of CPU: mark it slow, or give it smaller data")
    return result
