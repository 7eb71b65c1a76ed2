"""Methods that process a whole record to identify parameters or to set up filters.

`output_error` and `prediction_error` fit a model to a record with the help of `predictor`,
`trajectory` and `coulomb`. `frequency` computes frequency responses. `structure` and `roles`
determine which parameters an axis can have and which of these parameters are known. `priors`
computes P(0), the drift covariance Δ, and the expected tracking speed and noise of the estimates.
Each method receives u, y and a model, and returns parameters with their covariance, or initial
values for a filter.
"""
