"""Ground truth: everything that knows the true parameters of the axis."""
