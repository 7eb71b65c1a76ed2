"""The commands of `flexaxis`: each reads its options, calls `fx`, and prints the result.

`options` declares all options once; `run`, `judge`, `look` and `axis` hold the commands.
"""
