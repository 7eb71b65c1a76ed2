"""Rows as a table: columns, groups, cubes, exports; and what a run comes to."""
