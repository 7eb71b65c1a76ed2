"""Many logs of one axis: estimates of each, and what became of every parameter."""
