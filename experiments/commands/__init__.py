"""The commands: each reads its options, calls the Python interface and prints the result.

`options` declares every option once; `run`, `judge`, `look` and `axis` contain the commands.
"""
