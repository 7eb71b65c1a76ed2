"""Commands that look at what there is, and at what was found: list, show, report.

In come names or the folder of a run; out go text, tables, pictures, pages. Nothing is estimated.
"""
