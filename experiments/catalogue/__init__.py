"""The catalogue of scenarios and suites, with their descriptions.

`scenarios` and `suites` contain the TOML files, and `hashes.toml` the frozen hashes. `find` returns
the Scenario or Suite for a name or a path and checks its hash; `card` describes it.
"""
