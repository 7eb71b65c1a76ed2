"""One score: how it is made, pooled, named, shown and compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.scores import Track

Kind = Literal["text", "number", "integer", "truth"]


@dataclass(frozen=True)
class Score:
    """One score.

    Attributes
    ----------
    name : str
        Key in rows and summaries.
    of : callable
        ``of(track, i)`` of the i-th estimated parameter; None where it is not defined.
    words : str
        What it is, in a sentence.
    unit : str
        Empty for a plain number; every number must say which.
    better : {"less", "more"}, optional
        Which way is better; None for what is neither.
    pool : callable, optional
        ``pool(columns, name)``, what stands in the pooled row, as those of
        `flexaxis.experiments.scoring.pooling`: ``pooling.mean``, ``pooling.by(np.max)``. None
        for what is of one run only.
    heading : str
        Of its column in the report; one without has none.
    short : str
        Of its column in the terminal; one without has none.
    kind : {"number", "integer", "truth", "text"}
        What its column holds.
    parts : mapping of str to str
        Keys of a score that is a table, with their units; each is a column of its own.
    margin : float, optional
        A change smaller than this share does not matter to `compare`, which leaves out scores
        without one unless told.
    zero : float
        Less is as good as none [unit]: where any run has it, `compare` takes differences.
    guard : bool
        Of a score that may have any sign: `compare` looks at its modulus, as a share of the noise,
        and only says where it is worse.
    """

    name: str
    of: Callable[[Track, int], Any]
    words: str
    unit: str | None = None
    better: Literal["less", "more"] | None = None
    pool: pooling.Pool | None = None
    heading: str = ""
    short: str = ""
    kind: Kind = "number"
    parts: Mapping[str, str] = field(default_factory=dict)
    margin: float | None = None
    zero: float = 0.0
    guard: bool = False

    @property
    def compared(self) -> bool:
        """Whether `compare` can take it: a positive number of which less is better, or a guard."""
        return self.guard or (self.better == "less" and self.kind == "number")
