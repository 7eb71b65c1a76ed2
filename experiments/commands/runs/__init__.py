"""Commands that run estimators, and what belongs to it."""
