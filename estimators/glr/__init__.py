"""A joint Kalman filter with a bank of hypotheses: which parameter jumped, when, by how much."""
