"""Models of an axis: formulas, torque laws, discretisation and integration over a sample.

Tables of formulas in the physical parameters define a model. The package `models` uses these tables
to compute matrices, predictions and derivatives for any parameter values θ. `axis_models` contains
the shipped models and reads other models from tables. `model` and `laws` represent a model as data.
`series` integrates a model over one sample, and `implicit_torque` and `law_torques` add the
nonlinear torques. `discretisation` chooses the order of the power series for the state transition,
and can also compute the state transition with a matrix exponential. `memory` and `compiler` support
the compilation of the filters.
"""
