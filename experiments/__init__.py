"""The benchmark: scenarios, estimator runs, scores, reports and the command line.

The package `catalogue` contains scenarios and suites. The package `running` runs estimators, and
stores the results. The packages `scoring` and `comparison` compute scores and rankings, and
`reporting` writes report pages. Each of the packages `studies`, `gate`, `logs`, `demo`, `paper` and
`check` implements one group of commands. Users call the functions in `commands` from the command
line, and the functions in `front` after ``import flexaxis``.
"""
