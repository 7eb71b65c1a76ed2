"""Run studies: simulate scenarios, run estimators on the records, score the estimates, store rows.

`study` lists the units of work, `run` distributes them to worker processes, `case` does the work
there, `store` keeps the rows in one SQLite file, and `results` returns them as a pandas DataFrame.
`estimators` creates estimators from text, `user_code` loads user code and reports its errors,
`cache` stores simulated records, `estimate` runs one estimator on one record, and `progress` shows
a progress bar. The input is scenarios, estimators and seeds; the output is rows in a folder.
"""
