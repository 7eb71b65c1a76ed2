"""The commands of flexaxis, one module each.

A module in a folder here is a command, found by `experiments.cli`: it adds its options, and runs.
In come words that were typed (`words`, `options`), out come text or, with `--json`, one object on
stdout (`answers`), and an exit status.
"""
