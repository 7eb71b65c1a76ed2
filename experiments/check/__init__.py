"""The rules that an estimator must keep.

`check` has the rules and runs them on an estimator; `templates` has the estimators that
`flexaxis new` writes. Each rule returns whether it holds and why it matters.
"""
