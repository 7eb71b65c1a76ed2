"""A joint Kalman filter with a bank of hypotheses about parameter jumps.

The module `filter` contains the estimator, and `loop` contains the estimator's loop over the
samples. `bank` computes the weights of the hypotheses, and `comparison` decides which hypothesis to
accept. `initialisation` learns the structure of the axis from the first seconds of motion, and
`cogging` searches for torques that are periodic in the motor angle. `bank_arrays` defines the
arrays of the hypothesis bank, and `workspace` contains operations on these arrays. The estimator
outputs the parameter estimate θ, its covariance P and the detected jumps.
"""
