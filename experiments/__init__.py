"""Puts ground truth and estimators together: scenarios, scores, reports, the command line."""
