"""A robot's own logs: read, import, judge, identify, track.

`reading` opens a format, `mapping` finds the signals, `prepare` makes an even grid, `importing` a
record of it, with `doubts` about it. `identification` gives an axis, `track` parameters along a
log, `changes` and `trend` what became of them, `pages` the pages. In come files of whoever; out go
records, axis files, estimates and findings in words.
"""
