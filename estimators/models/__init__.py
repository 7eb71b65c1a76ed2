"""What an axis is and what it does in a sample: formulas, laws, discretisation.

`axes` has the shipped models, `model` and `laws` what one is made of, as data (`tables`: from
TOML). `series` takes it over one sample, `reaction` and `law_torques` with its laws;
`discretisation` has the same by a matrix exponential, and the order of the series. `memory` and
`compiler` are what compiled code needs. In come tables of formulas in the physical parameters; out
go matrices, predictions and their derivatives at any θ.
"""
