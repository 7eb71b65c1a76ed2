"""Components of the recursive filters: options, covariance updates and noise variance.

`filter` defines the interface of all filters, with the methods step, run and reset. `state`
contains the variables that all filters have in common. `prediction_error` and `forgetting`
implement the recursive prediction-error method. `joint` implements a Kalman filter that estimates
the state and the parameters, and `interacting_models` combines several joint filters. `design`
checks the options of a filter.
"""
