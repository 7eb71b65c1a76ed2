"""Fail tests that use far too much CPU time, unless they are marked `slow` or `browser`.

A fast test should use about one second.
"""

import os
import time

import pytest
from numba.core import event

LIMIT = 100.0  # [s] on the reference machine; loose, because a child process may compile first
REFERENCE = 0.1  # result of `additions` on the reference machine [s]
START, SHARED = pytest.StashKey[float](), pytest.StashKey[list]()
COMPILING = event.TimingListener()
event.register("numba:compile", COMPILING)


def additions():
    """Return the CPU time [s] of 3 million additions, a measure of the machine's current speed."""
    start, total = time.process_time(), 0
    for i in range(3_000_000):
        total += i
    return time.process_time() - start


def used():
    """Return the CPU time [s] of this process and its children, without time spent compiling."""
    return sum(os.times()[:4]) - (COMPILING.duration if COMPILING.done else 0.0)


def pytest_configure(config):
    """Initialise the CPU time of shared fixtures."""
    config.stash[SHARED] = [0.0]


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    """Add the CPU time of shared fixtures to a separate sum, not to the first test using them."""
    start = used()
    try:
        return (yield)
    finally:
        if fixturedef.scope != "function":
            request.config.stash[SHARED][0] += used() - start


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item):
    """Store the CPU time at which a test starts."""
    item.stash[START] = used() - item.config.stash[SHARED][0]
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item):
    """Fail a test that used too much CPU time, relative to the speed of this machine."""
    result = yield
    seconds = used() - item.config.stash[SHARED][0] - item.stash[START]
    if seconds > LIMIT and not {"slow", "browser"} & item.keywords.keys():
        seconds *= REFERENCE / max(additions() for _ in range(2))
        if seconds > LIMIT:
            pytest.fail(f"{seconds:.1f} s of CPU: mark it slow, or give it smaller data")
    return result
