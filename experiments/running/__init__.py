"""Run studies: simulate scenarios, run estimators on the records, score the estimates, store rows.

The input of a study consists of scenarios, estimators and seeds. The output is a folder with rows.
The module `study` splits a study into units of work, and the module `run` distributes the units to
worker processes. The module `case` runs the cases of a unit in a worker. The module `store` keeps
the rows in one SQLite file, and the module `results` returns the rows as a pandas DataFrame. The
module `estimators` creates an estimator from a text, and the module `user_code` loads user code and
reports its errors. The module `cache` stores simulated records, the module `estimate` runs one
estimator on one record, and the module `progress` shows a progress bar.
"""
