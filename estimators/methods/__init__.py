"""The estimators: each module defines one or more and the entries for their registration.

Each estimator is constructed from a problem and options, using `filters`, `glr` and `models`.
`estimators.registry` collects the entries from the variable ENTRIES of each module.
"""
