"""Studies and benchmarks: their definitions and the summaries of their results.

`definition` reads a study from TOML; `benchmark` runs it and writes its summary and report.
"""
