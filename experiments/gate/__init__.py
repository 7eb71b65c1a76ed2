"""The gate: whether a candidate estimator is better or worse than a base, or undecided.

`gate` adds seeds until it is decided, `pairs` makes pairs of rows, `decide` and `verdicts` give
the words, `equal_noise` tunes both sides first; `stored` compares two finished runs. In come two
estimators or two folders of rows, out goes a verdict a score.
"""
