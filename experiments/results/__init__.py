"""Rows as a table: columns, groups, cubes, exports.

`source` asks the rows of a folder in SQL, `results` gives them to Python, `groups` pools
them over seeds, `finds` counts what was found, `export` writes CSV, Parquet, NetCDF. In comes
the folder of a run or a study, out go tables.
"""
