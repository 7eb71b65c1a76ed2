"""What an estimator does with a model: options, P and its rules, noise, claims.

`filter` is the shape of all: step, run, reset; `state` is what they have in common. The parts are
`prediction_error` and `forgetting` (the paper's kind), `joint` (Kalman filters of state and
parameters) and `interacting_models`. In come a problem and options (`design`), out goes a filter.
"""
