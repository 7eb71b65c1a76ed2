"""Methods that process a whole record: identification, frequency responses, priors, theory.

`output_error` and `prediction_error` fit a model to a record, using `predictor`, `trajectory` and
`coulomb`; `frequency` estimates a frequency response without a physical model. `structure` and
`roles` determine which parameters an axis may have and which of them are known. `priors` computes
P(0), Δ and the expected tracking speed and noise. The inputs are u, y and a model; the outputs are
parameters with their covariance, or initial values for a filter.
"""
