"""The benchmark: scenarios, runs of estimators, scores, reports and the command line.

`catalogue` contains scenarios and suites. `running` runs estimators and stores one row per result.
`scoring` and `comparison` compute scores and rankings, and `reporting` writes pages. `studies`,
`gate`, `logs`, `demo`, `paper` and `check` use these packages. Users call `commands` (the command
line) or `front` (``import flexaxis``).
"""
