"""Provide the catalogue of scenarios and suites, and describe its entries.

The folders `scenarios` and `suites` contain the TOML files of the catalogue. The file `hashes.toml`
contains the frozen hash of each scenario. The module `find` returns the scenario or suite with a
given name or path, and checks the hash of the scenario. The module `card` describes scenarios,
suites and estimators.
"""
