"""The gate: whether a candidate estimator is better or worse than a base, or undecided."""
