"""Scenarios, suites and their cards: what there is to run."""
