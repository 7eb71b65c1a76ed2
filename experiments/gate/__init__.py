"""Decide whether a candidate estimator is better or worse than a base estimator.

The module `pairs` joins the rows of both estimators on common seeds, and the module `verdict`
judges the paired scores. The module `gate` adds seeds until the verdict is clear. The module
`equal_noise` tunes both estimators to the same noise before a comparison, and the module `report`
writes the result.
"""
