"""From the text of --estimator to an estimator, and whose code that runs."""
