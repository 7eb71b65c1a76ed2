"""The gate: decide whether a candidate estimator is better or worse than a base, or undecided.

`pairs` joins the rows of both on common seeds, `verdict` judges them, `gate` adds seeds until the
verdict is clear, `equal_noise` first tunes both to the same noise, and `report` writes the result.
"""
