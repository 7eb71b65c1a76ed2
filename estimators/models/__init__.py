"""What an axis is and what it does in a sample: formulas, laws, discretisation, the kernel."""
