"""What things cost: time a sample, the longest step, memory; and rivals beside them."""
