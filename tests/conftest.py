"""A fast test should use one second of CPU; far more fails it, unless it is marked `slow`."""

import os
import time

import pytest
from numba.core import event

LIMIT = 100.0  # s on the reference machine; loose: the first test of a machine compiles in a child
REFERENCE = 0.1  # s
START, SHARED = pytest.StashKey[float](), pytest.StashKey[list]()
COMPILING = event.TimingListener()
event.register("numba:compile", COMPILING)


def additions():
    """Return the CPU time [s] of 3 million additions: the speed of this machine just now."""
    start, total = time.process_time(), 0
    for i in range(3_000_000):
        total += i
    return time.process_time() - start


def used():
    """Return the CPU time [s] of this process and its children, without that of the compiler."""
    return sum(os.times()[:4]) - (COMPILING.duration if COMPILING.done else 0.0)


def pytest_configure(config):
    """Start with no time in shared fixtures."""
    config.stash[SHARED] = [0.0]


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    """Count what several tests share apart from the test that asks for it first."""
    start = used()
    try:
        return (yield)
    finally:
        if fixturedef.scope != "function":
            request.config.stash[SHARED][0] += used() - start


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item):
    """Note when a test begins."""
    item.stash[START] = used() - item.config.stash[SHARED][0]
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item):
    """Fail a test that took too long, measured in the speed of this machine."""
    result = yield
    seconds = used() - item.config.stash[SHARED][0] - item.stash[START]
    if seconds > LIMIT and not {"slow", "browser"} & item.keywords.keys():
        seconds *= REFERENCE / max(additions() for _ in range(2))
        if seconds > LIMIT:
            pytest.fail(f"{seconds:.1f} s of CPU: mark it slow, or give it smaller data")
    return result
