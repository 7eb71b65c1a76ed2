"""Two estimators, and a verdict: `compare`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from flexaxis._given import Scenarios, scenarios_of, seeds_of, texts_of
from flexaxis._results import working
from flexaxis._table import html_table, text_table
from flexaxis.experiments.gate import gate
from flexaxis.experiments.gate.report import as_dict

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The verdict on a candidate beside a base.

    Attributes
    ----------
    content : dict
        All that `flexaxis compare --json` prints: ``verdict, headline, advice, rows, legend`` …
    """

    content: dict[str, Any]

    @property
    def verdict(self) -> str:
        """The one word: worse, undecided, better, slight or same."""
        return str(self.content["verdict"])

    @property
    def base(self) -> str:
        """The base as it was run; with `match_std` its knob as tuned."""
        return str(self.content["base"])

    @property
    def candidate(self) -> str:
        """The candidate as it was run; with `match_std` its knob as tuned."""
        return str(self.content["candidate"])

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame, a line a score."""
        import pandas as pd

        return pd.DataFrame(self.content["rows"]).drop(columns="text")

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the change of each score with its interval, and the margin that matters.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Where to draw; new ones by default.

        Returns
        -------
        Axes
        """
        from flexaxis._draw import panels
        from flexaxis.experiments.reporting.figures import verdict_intervals

        axes = panels(ax, 1)[0]
        verdict_intervals(self.content["rows"], axes=axes)
        return axes

    def __repr__(self) -> str:
        c = self.content
        rows = [row["text"] for row in c["rows"]]
        table = text_table(c["columns"], rows, len(rows))
        return "\n".join([c["headline"], *c["advice"], "", table, "", *c["legend"]])

    def _repr_html_(self) -> str:
        c = self.content
        rows = [row["text"] for row in c["rows"]]
        table = html_table(c["columns"], rows, len(rows))
        lines = [f"<p>{escape(line)}</p>" for line in (*c["advice"], *c["legend"])]
        return f"<p><b>{escape(c['headline'])}</b></p>{table}{''.join(lines)}"


def compare(
    base: str | Callable[..., Any],
    candidate: str | Callable[..., Any],
    *,
    scenarios: Scenarios = gate.SUITE,
    seeds: int | str | Iterable[int] = 32,
    max_seeds: int = 0,
    match_std: bool = False,
    margins: Mapping[str, float] | None = None,
    jobs: int = 1,
    time_limit: float | None = None,
) -> Comparison:
    """Say whether a candidate is better or worse than a base, run on the same records.

    Parameters
    ----------
    base, candidate : str or class
        As for `benchmark`.
    scenarios : str, Scenario, or several of them
        Those that one of the two cannot read are left out; the verdict says so.
    seeds, jobs, time_limit
        As for `benchmark`.
    max_seeds : int
        Seeds are added up to so many while it is undecided.
    match_std : bool
        Whether to tune both to one noise first, and judge the lag at equal noise: equal std of the
        parameter that changes, or, where several do, equal excess prediction error.
    margins : mapping of str to float, optional
        Changes that do not matter, as shares: ``{"lag": 0.05}``; 2 % by default.

    Returns
    -------
    Comparison
        The verdict, and a line a scenario and score.

    Raises
    ------
    FlexaxisError
        If they have nothing in common; with `match_std` if one has no knob, or cannot be as noisy
        as the reference.
    """
    first, second = (texts_of([one])[0] for one in (base, candidate))
    everywhere, common = scenarios_of(scenarios), seeds_of(seeds)
    cases = 2 * len(everywhere) * max(max_seeds, len(common))
    about = f"at most {cases} cases"
    with working(about, cases, jobs=jobs, time_limit=time_limit) as runner:
        comparison = gate.compare(
            first, second, everywhere, common, runner, max_seeds=max_seeds,
            margins=gate.check_margins(margins or {}), match_std=match_std,
        )  # fmt: skip
    return Comparison(as_dict(comparison))
