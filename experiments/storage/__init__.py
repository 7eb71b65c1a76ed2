"""The rows of a run in files: their columns, one SQLite file a folder, and what goes with them.

`schema` says which columns there are, `store` keeps rows, each once, `traces` curves to be drawn,
`files` the names of files and how they are written. In come rows of finished cases, out they go
again, checked.
"""
