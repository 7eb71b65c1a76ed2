"""The commands: each reads its options, calls the front, and prints the result.

`options` declares all options once; `run`, `judge`, `look` and `axis` hold the commands.
"""
