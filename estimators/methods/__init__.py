"""The estimators, one module each, with the entry under which it is registered.

In come a problem and options, out goes an estimator built of `filters`, `glr` and `models`. What a
module has as ENTRIES is found by `estimators.registry`.
"""
