"""Models of an axis, and their integration over a sample: formulas, laws, discretisation.

`axes` contains the shipped models and reads others from tables; `model` and `laws` represent a
model as data. `series` integrates a model over one sample; `reaction` and `law_torques` add the
torques of its nonlinear laws. `discretisation` chooses the order of the series, and computes the
same transition with a matrix exponential. `memory` and `compiler` support compiled code. Tables of
formulas in the physical parameters define a model. These modules compute matrices, predictions and
their derivatives from the tables, at any θ.
"""
