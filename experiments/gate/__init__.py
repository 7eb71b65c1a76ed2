"""The gate: decide whether a candidate estimator is better or worse than a base, or undecided.

`pairs` joins the rows of both estimators on common seeds, `verdict` judges the paired scores,
`gate` adds seeds until the verdict is clear, `equal_noise` tunes both estimators to the same noise
before the comparison, and `report` writes the result.
"""
