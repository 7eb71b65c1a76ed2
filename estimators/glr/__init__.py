"""A joint Kalman filter with a bank of hypotheses about jumps of parameters.

The module `filter` contains the estimator, and `loop` contains its loop over the samples. `bank`
computes the weights of the hypotheses, and `comparison` decides which hypothesis to accept.
`first_seconds` learns the structure during initialisation, and `cogging` searches for torques that
are periodic in the motor angle. `records` defines the arrays of the bank, and `workspace` contains
operations on them. The input is a problem with options; the output is θ, P and the findings.
"""
