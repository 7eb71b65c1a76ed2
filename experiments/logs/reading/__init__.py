"""Logs in their formats: names and units first, then the columns that are asked for.

In comes a path (`log`): CSV, HDF5 (NetCDF-4, MAT v7.3), older MAT, Parquet; out go columns of
numbers with names and units.
"""
