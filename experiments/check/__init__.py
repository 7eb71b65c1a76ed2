"""The rules that an estimator must keep.

`check` has one function a rule and runs them on an estimator; `templates` has the estimators that
`flexaxis new` writes.
"""
