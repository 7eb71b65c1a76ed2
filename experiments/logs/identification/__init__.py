"""Nominal values of an axis from its log.

`identify` tries three fits (`candidates`) from several `starts`, adds what the log asks for
(`laws`, `friction`), and judges on pieces that were not fitted (`validate`, `verdict`). In come a
log and a model, out go an axis with deviations and what speaks against it.
"""
