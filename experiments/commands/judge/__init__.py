"""Commands that judge estimators: compare, tradeoff, tune, check, and the board's.

In come estimators as texts or files; out go verdicts with an exit status, tables, entries, pages.
"""
