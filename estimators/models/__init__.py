"""What an axis is and what it does in a sample: formulas, laws, discretisation, the kernel.

`axes` has the shipped models, `model` and `laws` what one is made of, as data (`tables`: from
TOML). `discretisation` and `kernel` take it over one sample, `reaction` and `law_torques` with its
laws, as source that `compiler` compiles. In come tables of formulas in the physical parameters;
out go matrices, predictions and their derivatives at any θ.
"""
