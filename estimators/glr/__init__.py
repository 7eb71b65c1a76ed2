"""A joint Kalman filter with a bank of hypotheses: which parameter jumped, when, by how much.

`filter` is the estimator and `loop` its samples; `bank` weighs hypotheses, `mixture` is what they
say together, `comparison` decides which one to believe. `first_seconds` learns the structure,
`cogging` looks for torques over the angle. In comes a problem with options, out go θ, P and
findings.
"""
