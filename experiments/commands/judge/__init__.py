"""Commands that judge estimators."""
