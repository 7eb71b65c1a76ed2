"""The report of a run.

`first` is the top: answers and the table that ranks; `tables`, `measures`, `over_time`, `speed`
and `singles` are its parts, `page` puts them together. In comes a pooled run, out goes one
HTML file.
"""
