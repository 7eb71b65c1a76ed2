"""The commands. Each command reads its options, calls the Python interface and prints the result.

`options` declares all options, and `run`, `judge`, `look` and `axis` contain the commands.
"""
