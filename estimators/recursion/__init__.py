"""What recursive estimators share: options, the sample, the loop, and how they are run."""
