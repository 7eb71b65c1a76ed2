"""What an estimator must keep, and the checks of it.

`requirements` are the rules, `endurance` what sensors do in a year; `check` runs them on a
`subject`, `plugin` gives them to pytest. In comes an estimator, out goes a result for each rule.
`templates` has the estimator that the command new writes.
"""
