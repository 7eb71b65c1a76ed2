"""Define and run studies and benchmarks, and summarize their results.

The module `definition` reads a study from a TOML file. The module `benchmark` runs a study, and
writes the summary and the report.
"""
