"""What an estimator must keep, and the checks of it.

`requirements` are the rules; `check` runs them on a `subject`. In comes an estimator, out goes a
result for each rule.
`templates` has the estimator that the command new writes.
"""
