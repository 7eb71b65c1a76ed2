"""The commands. Each command reads its options, calls the Python interface and prints the result.

The module `options` declares all options. All other modules in this package contain the commands.
"""
