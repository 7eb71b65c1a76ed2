"""The catalogue of scenarios and suites, with their descriptions.

`scenarios` and `suites` hold the TOML files, and `hashes.toml` the frozen hashes. `find` returns
the Scenario or Suite of a name or a path and checks its hash; `card` describes it.
"""
