"""The catalogue of scenarios and suites, with their descriptions.

`scenarios` and `suites` hold the TOML files, `hashes.toml` what they are frozen at. In comes a
name or a path (`find`), out go a Scenario or a Suite, checked against its hash, and its
`card`.
"""
