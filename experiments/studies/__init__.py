"""Studies and benchmarks: what the engine is to run, and the summary of what it ran.

`definition` reads a study from TOML; `benchmark` runs one, and writes its summary and report.
"""
