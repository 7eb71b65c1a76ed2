"""The catalogue of scenarios and suites, with their descriptions.

The folders `scenarios` and `suites` contain the TOML files, and `hashes.toml` contains the frozen
hashes. `find` returns the scenario or suite with a given name or path, and checks the hash of a
scenario. `card` describes scenarios, suites and estimators.
"""
