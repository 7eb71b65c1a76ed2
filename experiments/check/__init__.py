"""The rules that an estimator must keep.

`rules` has one function a rule, `check` runs them on an estimator; `templates` has the estimators
that `flexaxis new` writes. Each rule returns whether it holds and why it matters.
"""
