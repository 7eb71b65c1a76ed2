"""What is asked of the engine: studies from files, runs, sweeps over knobs, tuning.

`definition` reads a study, `design` makes the points of its axes, `benchmark` is a run with
summary and report; `sweep` turns `knobs` to compare at equal noise, `as_set` does not, `tuning`
finds a setting and keeps it. In come TOML or names, out go folders of results.
"""
