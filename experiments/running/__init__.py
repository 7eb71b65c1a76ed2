"""Run studies: simulate scenarios, run estimators on the records, and score the estimates.

The input of a study consists of scenarios, estimators and seeds. The output of a study is a folder
with tables of scores. The module `study` splits a study into units of work, and the module `runner`
distributes the units to worker processes. The module `case` runs all estimators of a unit in a
worker process. The module `store` keeps the scores in one SQLite file, and the module `results`
returns the scores as a pandas DataFrame. The module `estimators` creates an estimator from the
value of the option `--estimator`, and the module `user_code` loads user code and reports its
errors. The module `cache` stores simulated records, the module `estimate` runs one estimator on one
record, and the module `progress` shows a progress bar.
"""
