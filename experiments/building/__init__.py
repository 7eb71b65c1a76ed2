"""From the text of --estimator to an estimator, and whose code that runs.

`estimator_text` reads the text, `offer` says what the estimator may know, `ready` keeps built
ones. Code of users comes in by `code` (who is asked), `imports` and `neighbours`, is a `guest`
while it runs, or a `pipe` to another process; `crashes` says what failed. In come a text and a
scenario or an axis, out goes an estimator.
"""
