"""The benchmark with scenarios, estimator runs, scores, reports and the command line.

The package `catalogue` contains scenarios and suites. The package `running` runs estimators, and
stores the results. The packages `scoring` and `comparison` compute scores and rankings, and
`reporting` writes report pages. The packages `studies`, `gate`, `logs`, `demo`, `paper` and `check`
use the other packages. Users call `commands` (the command line) or `front` (``import flexaxis``).
"""
