"""Commands to teach with."""
