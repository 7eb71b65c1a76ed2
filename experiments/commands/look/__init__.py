"""Commands that look at what there is, and at what was found."""
