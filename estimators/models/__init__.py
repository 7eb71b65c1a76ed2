"""Models of an axis, and their integration over a sample: formulas, laws, discretisation.

`axes` has the shipped models and reads others from tables; `model` and `laws` describe them as
data. `series` integrates a model over one sample, `reaction` and `law_torques` add its laws.
`discretisation` chooses the order of the series, and does the same by a matrix exponential.
`memory` and `compiler` serve compiled code. The input are tables of formulas in the physical
parameters, the output are matrices, predictions and their derivatives at any θ.
"""
