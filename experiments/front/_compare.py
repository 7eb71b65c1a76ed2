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
from flexaxis.experiments.gate.pairs import parse_margins
from flexaxis.experiments.gate.wording import COLUMNS, cells, headline, knobs, meaning, ordered
from flexaxis.experiments.studies.bench import Bench

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """What can be said of a candidate beside a base.

    Attributes
    ----------
    found : flexaxis.experiments.gate.gate.Comparison
        All that was found, as `flexaxis compare` writes it.
    left_out : mapping of str to str
        Scenarios that one of them cannot read, with the reason.
    """

    found: gate.Comparison
    left_out: Mapping[str, str]

    @property
    def verdict(self) -> str:
        """The one word: worse, undecided, better, slight or same."""
        return self.found.verdict

    @property
    def base(self) -> str:
        """The base as it was run; with `match_std` its knob as tuned."""
        return self.found.base

    @property
    def candidate(self) -> str:
        """The candidate as it was run; with `match_std` its knob as tuned."""
        return self.found.candidate

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame, a line a score."""
        import pandas as pd

        return pd.DataFrame(self.found.as_dict()["rows"])

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
        from flexaxis.experiments.reporting.compare import changes
        from flexaxis.experiments.reporting.figures import verdict_intervals

        axes = panels(ax, 1)[0]
        verdict_intervals(changes(self.found.as_dict()), axes=axes)
        return axes

    def _said(self) -> list[str]:
        lines = [headline(self.found), meaning(self.found), knobs(self.found)]
        lines += [f"{name} is left out: {why}" for name, why in self.left_out.items()]
        return [line for line in lines if line]

    def _cells(self) -> list[tuple[str, ...]]:
        return [cells(v) for v in ordered(self.found.verdicts)]

    def __repr__(self) -> str:
        rows = self._cells()
        return "\n".join([text_table(COLUMNS, rows, len(rows)), "", *self._said()])

    def _repr_html_(self) -> str:
        first, *others = self._said()
        more = "".join(f"<p>{escape(line)}</p>" for line in others)
        rows = self._cells()
        return f"<p><b>{escape(first)}</b></p>{html_table(COLUMNS, rows, len(rows))}{more}"


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
    wanted = parse_margins([f"{name}={value!r}" for name, value in (margins or {}).items()])
    everywhere, common = scenarios_of(scenarios), seeds_of(seeds)
    most = 2 * len(everywhere) * max(max_seeds, len(common))
    with working(f"at most {most} cases", most, jobs=jobs, time_limit=time_limit) as runner:
        question, left_out = gate.ask(
            first, second, everywhere, common, wanted, max_seeds, runner=runner
        )
        found = gate.compare(question, Bench(runner), match_std=match_std)
    return Comparison(found, left_out)
