"""What to doubt of a log before anything is estimated: one module a doubt."""
