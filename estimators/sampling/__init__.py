"""One way to take a model and its derivatives over a sample, compiled for its pattern."""
