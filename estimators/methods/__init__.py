"""The estimation methods; each module defines and registers one or more estimators.

For each estimator, a function constructs the estimator from an estimation problem and options. The
methods use the packages `filters`, `glr`, `offline` and `models`. The variable ENTRIES of each
module contains the registry entries of the estimators.
"""
