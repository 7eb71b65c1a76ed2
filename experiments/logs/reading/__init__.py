"""Logs in their formats: names and units first, then the columns that are asked for."""
