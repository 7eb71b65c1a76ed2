"""The rows of a run in files: their columns, one SQLite file a folder, and what goes with them."""
