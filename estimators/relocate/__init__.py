"""The estimator that detects a jump, rewinds to it and refits: memory to policy."""
