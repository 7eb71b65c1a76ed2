"""The commands of `flexaxis`, one module each."""
