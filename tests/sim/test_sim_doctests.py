"""The examples in the docstrings do what they say."""

import doctest
import importlib
import pkgutil

import pytest

import flexaxis.models_mjcf
import flexaxis.sim

MODULES = ["flexaxis.models_mjcf"] + [
    f"flexaxis.sim.{module.name}" for module in pkgutil.iter_modules(flexaxis.sim.__path__)
]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0
