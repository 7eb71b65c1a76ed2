"""Studies and benchmarks: what the engine is to run, and the summary of what it ran.

`definition` reads a study from TOML, `design` makes the points of its axes, `benchmark` runs
scenarios with a summary and a report, and `as_set` compares estimators at their default settings.
"""
