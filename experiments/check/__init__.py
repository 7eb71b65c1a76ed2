"""What an estimator must keep, and the check of it.

`check` has the rules, and runs them on an estimator; `templates` has the estimators that the
command new writes.
"""
