"""Provide the catalogue of scenarios and suites, and describe its entries.

The folders `scenarios` and `suites` contain the TOML files of the catalogue. The file `hashes.toml`
contains the frozen hash of each scenario. The module `find` finds a scenario or a suite by its name
or path, and checks that scenarios match their hashes. The module `card` describes scenarios, suites
and estimators.
"""
