"""What is compared, and how large a change matters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flexaxis.experiments.scoring import table as scores
from flexaxis.sim.errors import FlexaxisError, did_you_mean

METRICS: Mapping[str, str] = {name: scores.SCORES[name].unit or "" for name in scores.METRICS}
"""Scores that can be compared, with their units."""

MARGINS: Mapping[str, float] = scores.MARGINS
"""What is compared unless told otherwise, and how large a change matters (.02 is 2 %)."""


def parse_margins(texts: Sequence[str]) -> dict[str, float]:
    """Return the margins with those of texts such as ``lag=2%`` added or changed.

    A text may hold several, with commas between them.

    Examples
    --------
    >>> parse_margins(["lag=5%,t10=0.1"])
    {'lag': 0.05, 'std': 0.02, 'bias': 0.2, 't10': 0.1}
    """
    margins = dict(MARGINS)
    for text in (part.strip() for given in texts for part in given.split(",")):
        metric, _, number = text.partition("=")
        if metric not in METRICS:
            raise FlexaxisError(
                f"--margin {text!r}: there is no metric {metric!r}."
                f"{did_you_mean(metric, METRICS)} There are: {', '.join(METRICS)}"
            )
        try:
            value = float(number.removesuffix("%")) / (100 if number.endswith("%") else 1)
        except ValueError:
            value = -1.0
        if not 0 < value < 1:
            raise FlexaxisError(
                f"--margin {text!r}: write a share between 0 and 100 %, as in {metric}=2%"
            )
        margins[metric] = value
    return margins
