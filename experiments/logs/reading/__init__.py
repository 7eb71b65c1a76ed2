"""Logs in the formats that there are: names and units first, then the columns that are asked for."""
