"""What an axis is: a linear grey-box model as tables of formulas."""
