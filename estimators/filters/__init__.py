"""What an estimator does with a model: options, the loop, P and its rules, noise, claims."""
