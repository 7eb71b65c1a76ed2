"""Models of an axis: formulas, torque laws, discretisation and integration over a sample.

Tables of formulas in the physical parameters define a model. The package `models` computes
matrices, predictions and derivatives from the tables for any parameter values θ. `axes` contains
the shipped models and reads other models from tables. `model` and `laws` represent a model as data.
`series` integrates a model over one sample, and `reaction` and `law_torques` add the nonlinear
torques. `discretisation` chooses the order of the power series, and can compute the same state
transition with a matrix exponential instead. `memory` and `compiler` support the compilation of the
filters.
"""
