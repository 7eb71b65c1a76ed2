"""Nominal values of an axis from its log."""
