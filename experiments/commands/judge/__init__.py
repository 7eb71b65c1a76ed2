"""Commands that judge estimators: compare, tune, check, new.

In come estimators as texts or files; out go verdicts with an exit status, tables, entries, pages.
"""
