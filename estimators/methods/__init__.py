"""The estimators, one module each, with the entry under which it is registered."""
