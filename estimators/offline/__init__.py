"""What looks at a whole record: identification, frequency responses, priors, theory."""
