"""Check an estimator against rules, and provide templates for new estimators.

The module `check` contains one function for each rule. The module `template` copies one of the
`templates` to a new file, which a user can then change.
"""
