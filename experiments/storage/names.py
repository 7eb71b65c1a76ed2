"""The names of what is in the folder of a run or a study.

study.json says what is studied; scores.sqlite, or scores-I-of-N.sqlite of each share, has the rows,
and what the figures of a run are drawn from; trajectories/ estimates that were kept; summary.json,
curves.nc and report.html are made of these when all is done.
"""

from __future__ import annotations

STUDY, TRAJECTORIES = "study.json", "trajectories"
REPORT = "report.html"
SUMMARY, CURVES, SWEEP = "summary.json", "curves.nc", "sweep"
COMPLETE = (SUMMARY, "compare.json", "tradeoff.json")
"""What is written last: a folder without any of these is not complete."""
MADE = (CURVES, REPORT, "verdict.md", "tradeoff.svg")
