"""Methods that process a whole record, for identification and for the setup of filters.

`output_error` and `prediction_error` fit a model to a record, using `predictor`, `trajectory` and
`coulomb`. `frequency` computes frequency responses. `structure` and `roles` determine the possible
parameters of an axis and which of these parameters are known. `priors` computes P(0), Δ and the
expected tracking speed and noise. The inputs are u, y and a model. The outputs are parameters with
their covariance, or initial values for a filter.
"""
