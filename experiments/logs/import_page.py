"""The page of an import: what to doubt first, each with what to type and a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from flexaxis.experiments.logs.doubts.doubt import Doubt
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.log_figures import doubt_figure, log_figure, visibility_figure
from flexaxis.experiments.logs.log_page import LogPage
from flexaxis.experiments.logs.visibility import Seen

ORDER = {"problem": 0, "note": 1, "ok": 2}


def import_page(found: Imported, seen: Mapping[str, Seen], log: Path, command: str) -> LogPage:
    """Return the page of an import.

    Parameters
    ----------
    found : Imported
    seen : mapping of str to Seen
        What the excitation tells of each parameter, if a model was named.
    log : Path
    command : str
        That made it.
    """
    doubts = sorted(found.checks, key=lambda check: ORDER[check.verdict])
    return LogPage(
        title=f"Import of {log.name}",
        command=command,
        remarks=[(c.verdict, _remark(c)) for c in doubts if c.verdict != "ok"],
        tables=_tables(found.checks, seen),
        figures=_figures(found, doubts, seen),
    )


def _remark(doubt: Doubt) -> str:
    text = f"{doubt.name}: {doubt.text}"
    return f"{text}. Type: {doubt.command}" if doubt.command else text


def _tables(
    checks: Sequence[Doubt], seen: Mapping[str, Seen]
) -> list[tuple[str, Sequence[str], Sequence[Sequence[str]]]]:
    head = ("", "measured", "", "", "what to type")
    rows = [(c.name, c.measured, c.verdict, c.text, c.command) for c in checks]
    tables: list[tuple[str, Sequence[str], Sequence[Sequence[str]]]] = [
        ("Plausibility", head, rows)
    ]
    if seen:
        lines = [(name, one.words) for name, one in seen.items()]
        tables.append(("What the excitation can see", ("parameter", ""), lines))
    return tables


def _figures(
    found: Imported, doubts: Sequence[Doubt], seen: Mapping[str, Seen]
) -> list[tuple[str, Figure, str]]:
    figures = [
        (f"Doubt: {doubt.name}", doubt_figure(doubt), _remark(doubt))
        for doubt in doubts
        if doubt.verdict != "ok" and doubt.draw is not None
    ]
    figures.append(("The log", log_figure(found.record), ""))
    if seen:
        text = "From the spectrum of the torque, about, by a linear model; orange is not seen."
        figures.append(("What the excitation can see", visibility_figure(seen), text))
    return figures
