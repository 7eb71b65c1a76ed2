"""The names of what is in the folder of a run or a study.

study.json says what is studied; scores.jsonl, or scores-I-of-N.jsonl of each share, has the rows;
traces/ what the figures of a run are drawn from, trajectories/ estimates that were kept;
summary.json, curves.nc and report.html are made of these when all is done.
"""

from __future__ import annotations

STUDY, SCORES, LOCK, TRAJECTORIES = "study.json", "scores.jsonl", ".lock", "trajectories"
REPORT = "report.html"
SUMMARY, CURVES, PREVIOUS, SWEEP = "summary.json", "curves.nc", "previous", "sweep"
COMPLETE = (SUMMARY, "compare.json", "tradeoff.json")
"""What is written last: a folder without any of these is not complete."""
COLUMNS = ".columns.h5"
MADE = (CURVES, REPORT, "verdict.md", "tradeoff.svg", COLUMNS)
