"""Puts ground truth and estimators together: scenarios, scores, reports, the command line.

The way of the data: `catalogue` (what there is to run), `running` (from a study to rows), `scoring`
and `comparison` (what they are worth), `reporting` (pages). On it stand `studies`, `gate`, `logs`,
`demo`, `paper` and `check`; `commands` and `front` (import flexaxis) are the two ways in. In
come names and files that a user gives, out go rows, verdicts and pages.
"""
