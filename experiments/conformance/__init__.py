"""What an estimator must keep, and the checks of it."""
