"""Commands for your own axis and its logs."""
