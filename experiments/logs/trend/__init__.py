"""Many logs of one axis: estimates of each, and what became of every parameter.

`estimates` and `refit` give a row a log, `covariates` when and how warm it was, `scatter` how rows
scatter; `change_points` finds steps and ramps, `wear` tells worn from warm, `words` says it. In
come logs and an axis, out goes a verdict on each parameter.
"""
