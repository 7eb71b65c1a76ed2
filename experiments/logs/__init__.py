"""Read, import and check logs of a real axis, identify the axis, and track its parameters.

`read` opens a file, `mapping` selects the signals, `importing` converts the log to an evenly
sampled record, and `checks` examines the log. `search` and `fit` identify an axis, and `verdict`
decides whether the estimates can be used. `track` tracks parameters along one log,
`identify.identify_many` compares many logs, and `changes` finds when parameters changed. `pages`
writes an HTML page for each result.
"""
