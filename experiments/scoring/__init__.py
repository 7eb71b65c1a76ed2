"""What a score is: scores of a case, theory beside them, pooling, intervals."""
