"""Estimators beside each other: at equal noise, ranked, and what chance leaves of it."""
