"""Logs of a real axis: read, import, check, identify, track.

`read` opens a file, `mapping` selects the signals, `importing` makes a record on an even grid, and
`checks` examines the log. `search` and `fit` identify an axis, and `verdict` decides whether the
estimates can be used. `track` tracks parameters along one log, `many` compares many logs, and
`changes` finds when parameters changed. `pages` writes an HTML page of each result.
"""
