"""Commands for your own axis and its logs: import, identify, track, trend, days.

In come logs or records and the file of an axis; out go records, axis files, estimates and pages.
"""
