"""From the text of --estimator to an estimator, and whose code that runs.

`estimator_text` reads the text, `offer` says what the estimator may know, `ready` keeps built
ones. Code of users comes in by `code` (who is asked), lives `away` in a process of `processes`,
where `imports` loads it and where it is a `guest` while it runs, or behind a `pipe`; `crashes` says
what failed, `interrupts` what Ctrl-C ends. In come a text and a scenario or an axis, out goes an
estimator.
"""
