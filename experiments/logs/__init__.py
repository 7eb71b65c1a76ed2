"""Logs of a real axis: read, import, check, identify, track.

`read` opens a format, `mapping` picks the signals, `prepare` makes an even grid and `importing` a
record, with the findings of `checks`. `search` and `fit` identify an axis, `verdict` says whether
its numbers can be used; `track` follows parameters along a log, `many` over logs, and
`changes` finds when they changed. `pages` shows it.
"""
