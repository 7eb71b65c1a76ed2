"""Run studies: simulate scenarios, run estimators on the records, score the estimates, store rows.

`study` lists the units of work, `run` distributes the units to worker processes, `case` runs the
cases of a unit in a worker, `store` keeps the rows in one SQLite file, and `results` returns the
rows as a pandas DataFrame. `estimators` creates an estimator from a string, `user_code` loads user
code and reports errors in it, `cache` stores simulated records, `estimate` runs one estimator on
one record, and `progress` shows a progress bar. The input consists of scenarios, estimators and
seeds; the output is a folder with rows.
"""
