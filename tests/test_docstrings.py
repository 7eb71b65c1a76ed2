"""The examples in docstrings run, and say what they say."""

import doctest
import importlib
import pkgutil

import pytest

PACKAGES = ("models_mjcf", "sim", "estimators", "experiments")


def modules():
    for name in PACKAGES:
        package = importlib.import_module(f"flexaxis.{name}")
        yield package.__name__
        for info in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if not info.name.endswith("__main__"):
                yield info.name


LONG = "flexaxis.experiments.front._running"  # its example is a benchmark


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n == LONG)) for n in sorted(modules())]
)
def test_examples(name):
    result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0
