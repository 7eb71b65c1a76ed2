"""The estimators: each module defines one or more estimators and registers them.

A function constructs each estimator from a problem and options, using the packages `filters`,
`glr`, `offline` and `models`. `estimators.registry` collects the entries from the variable ENTRIES
of each module.
"""
