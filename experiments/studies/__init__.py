"""Studies and benchmarks: their definitions and the summaries of their results.

`definition` reads a study from TOML; `benchmark` runs a study and writes its summary and report.
"""
