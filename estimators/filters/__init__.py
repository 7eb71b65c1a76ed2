"""Components of the recursive filters: options, updates of P, noise variance, claimed covariance.

`filter` defines the interface of all filters: step, run, reset. `state` contains the variables that
all filters have in common. `prediction_error` and `forgetting` implement the paper's method;
`joint` implements Kalman filters for state and parameters, and `interacting_models` combines
several of these. `design` checks the options from which a filter is constructed.
"""
