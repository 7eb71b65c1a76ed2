"""Estimators beside each other: at equal noise, ranked, and what chance leaves of it.

`matching` reads lags off at equal noise, `ranking` says who leads and who is tied, `statistics`
has the tests, `ecdf` and `mismatch` two more views. In come rows of scores by seed, or pooled; out
go numbers with intervals, marks and sentences.
"""
