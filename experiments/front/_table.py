"""Lines of a table that show themselves: in a terminal, in a notebook, as a DataFrame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.reporting.tables import number

if TYPE_CHECKING:
    import pandas

Line = Mapping[str, Any]
SHOWN = 30
"""Lines that are shown; a longer table says how many it has."""


class ShownTable(Sequence[Line]):
    """Some lines with the same columns; a sequence of mappings.

    Parameters
    ----------
    lines : sequence of mapping
    shown : sequence of str, optional
        Columns to show; `to_dataframe` has all.
    heads : mapping of str to str, optional
        What stands over a column that is shown; its name by default.
    """

    def __init__(
        self,
        lines: Sequence[Line],
        shown: Sequence[str] = (),
        heads: Mapping[str, str] | None = None,
    ) -> None:
        self._lines, self._named = list(lines), dict(heads or {})
        self._shown = list(shown or (self._lines[0] if self._lines else ()))

    def __getitem__(self, place: Any) -> Any:
        """Return a line, or some of them."""
        found = self._lines[place]
        return ShownTable(found, self._shown, self._named) if isinstance(place, slice) else found

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self._lines)

    def __repr__(self) -> str:
        return text_table(self._heads(), list(self._cells()), len(self))

    def _repr_html_(self) -> str:
        return html_table(self._heads(), list(self._cells()), len(self))

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame of all columns."""
        import pandas as pd

        return pd.DataFrame(self._lines)

    def _heads(self) -> list[str]:
        return [self._named.get(column, column) for column in self._shown]

    def _cells(self) -> Iterator[list[str]]:
        for line in self._lines[:SHOWN]:
            yield [cell(line.get(column)) for column in self._shown]


class Names(tuple[str, ...]):
    """Some names, which show themselves with what is known of each."""

    table: ShownTable

    @classmethod
    def of(cls, lines: Sequence[Line], shown: Sequence[str]) -> Names:
        """Return the names of some lines, which are in their column `name`."""
        found = cls(line["name"] for line in lines)
        found.table = ShownTable(lines, shown)
        return found

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame, a line a name."""
        return self.table.to_dataframe()


def cell(value: Any) -> str:
    """Return a value as it stands in a cell."""
    if isinstance(value, float) or value is None:
        return number(value)
    return str(value)


def text_table(heads: Sequence[str], rows: Sequence[Sequence[str]], total: int) -> str:
    """Return a table as text, its columns in line."""
    lines = [list(heads), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = [
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines
    ]
    return "\n".join([*text, *_more(len(rows), total)])


def html_table(heads: Sequence[str], rows: Sequence[Sequence[str]], total: int) -> str:
    """Return a table as HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows
    )
    more = "".join(f"<p>{escape(text)}</p>" for text in _more(len(rows), total))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _more(shown: int, total: int) -> list[str]:
    return [f"… {total - shown} more"] if total > shown else []
