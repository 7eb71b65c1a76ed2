"""The rules that an estimator must follow.

`check` has one function per rule and runs all rules on an estimator; `template` copies one of the
`templates` for a user to change.
"""
