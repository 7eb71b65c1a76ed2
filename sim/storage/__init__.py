"""Files: records as NetCDF, texts as TOML or JSON, whole or not at all.

In come files of whoever, which are looked into before they are believed; out go tables and arrays.
"""
