"""Commands that run estimators, and what belongs to it: run, study, simulate, estimate.

In come scenarios, estimators and seeds; out go records, estimates, or a folder of rows and a
report.
"""
