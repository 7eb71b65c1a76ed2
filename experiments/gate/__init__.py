"""Decide whether a candidate estimator is better or worse than a base estimator.

The module `pairs` pairs the scores of both estimators by seed, and the module `verdict` judges the
paired scores. The module `gate` adds random seeds until the verdict is clear. The module
`match_std` tunes both estimators to the same noise before a comparison, and the module `report`
writes the result.
"""
