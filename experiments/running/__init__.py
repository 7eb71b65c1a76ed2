"""From a study to rows: simulate, estimate, score, store.

`study` lists the units of work, `run` hands them to worker processes, `case` does the work there,
`store` keeps the rows in one SQLite file, and `results` gives them as a pandas DataFrame.
`estimators` turns text into estimators, `user_code` loads and reports on code that is not ours,
`cache` keeps simulated records, `estimate` runs one estimator on one record, `progress` says how
far it is. In come scenarios, estimators and seeds, out go rows in a folder.
"""
