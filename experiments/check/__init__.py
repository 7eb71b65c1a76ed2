"""Check whether an estimator follows the benchmark rules, and provide templates for estimators.

The module `check` contains one function for each rule that an estimator must follow. The module
`template` copies a working template estimator to a new file for the user to edit.
"""
