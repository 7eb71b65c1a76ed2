"""Runs estimators on simulated records: scenarios, scores, reports and the command line.

Data pass through `catalogue` (scenarios and suites), `running` (from a study to rows), `scoring`
and `comparison` (scores and rankings) and `reporting` (pages). `studies`, `gate`, `logs`, `demo`,
`paper` and `check` build on these. Users call `commands` (the command line) or `front`
(``import flexaxis``): they give names and files, and get rows, verdicts and pages.
"""
