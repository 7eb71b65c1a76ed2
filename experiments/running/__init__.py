"""From a plan to rows: cases on records, many processes, shares and what is merged of them.

`study` is what is asked for, `plan` what of it is missing, `engine` runs it on many processes or
any executor, `work` is what one of them does: simulate or take from the `cache`, run a `case`,
score it. `estimate` runs one estimator from file to file. In come scenarios, estimators, seeds; out
go rows in a `folder`.
"""
