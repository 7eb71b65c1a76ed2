"""The rules that an estimator must keep.

`check` has one function a rule and runs them on an estimator; `template` writes one of those in
`templates` for a user to change.
"""
