"""The rules that an estimator must follow.

`check` contains one function per rule and checks an estimator against all rules. `template` copies
one of the `templates`, which a user can change.
"""
