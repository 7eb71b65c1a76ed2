"""A robot's own logs: read, import, judge, identify, track."""
