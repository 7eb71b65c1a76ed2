"""The commands. Each command reads its options, calls the Python interface and prints the result.

The module `options` declares all options. The other modules contain the commands.
"""
