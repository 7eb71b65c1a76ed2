"""SCORES: every score there is, once: how it is made, pooled, named and shown.

Rows, summaries, tables, reports, columns of studies, exports and `compare` read it from here, so
that a new score is one entry.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from flexaxis.experiments.scoring import (
    bounds,
    consistency,
    detection,
    excess,
    pooling,
    recovered,
    scores,
)
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
        """Whether `compare` can use it: a positive number for which less is better, or a guard."""
        return self.guard or (self.better == "less" and self.kind == "number")


AFTER = tuple(map(str, bounds.RMSE_AT))  # samples after onset

SCORES: Mapping[str, Score] = {
    score.name: score
    for score in (
        Score(
            "lag",
            scores.lag_of,
            "T Σ |θ̃|/D over 5 s after the fault, or until the next event; D is the size of the "
            "fault. Where nothing moves at the fault, the clock starts when the excitation "
            "returns. Geometric mean over the runs.",
            unit="s",
            better="less",
            pool=pooling.geometric,
            heading="lag",
            short="lag",
            margin=0.02,
            zero=1e-3,
        ),
        Score(
            "t10",
            scores.t10_of,
            "The last time that the error leaves ±10 % of the fault, within the same window. "
            "Median over the runs; never settled and lost runs count as never.",
            unit="s",
            better="less",
            pool=pooling.median,
            heading="t10",
            short="t10",
            zero=0.01,
        ),
        Score(
            "std",
            scores.std_of,
            "Standard deviation of the error before the fault (last 5 s of excitation; last 10 s "
            "without a fault), over time and runs about their common mean.",
            unit="%",
            better="less",
            pool=pooling.deviation("bias", "lost_before"),
            heading="std",
            short="std",
            margin=0.02,
            zero=1e-3,
        ),
        Score(
            "bias",
            scores.bias_of,
            "Mean of the error in the same time, over all runs.",
            unit="%",
            pool=pooling.mean,
            heading="bias",
            margin=0.2,
            guard=True,
        ),
        Score(
            "std_after",
            scores.std_after_of,
            "Standard deviation of the error in the last 2 s of the window after the fault: who "
            "is quiet before a fault only because it is frozen is not quiet here.",
            unit="%",
            better="less",
            pool=pooling.deviation("bias_after", "lost_after"),
            heading="std after",
            zero=1e-3,
        ),
        Score(
            "bias_after",
            scores.bias_after_of,
            "Mean of the error in the same time.",
            unit="%",
            pool=pooling.mean,
        ),
        Score(
            "cross_talk",
            scores.cross_talk_of,
            "Root mean square error that the fault causes in a parameter that did not change.",
            unit="%",
            better="less",
            pool=pooling.root_mean_square,
            heading="cross-talk",
            zero=1e-3,
        ),
        Score(
            "excess",
            excess.excess_of,
            "What the errors of all estimated parameters add to the prediction error before the "
            "fault, θ̃ᵀQθ̃/σ²: one number for all of them, whatever their units.",
            unit="",
            better="less",
            pool=pooling.mean,
            heading="excess error",
            zero=1e-4,
        ),
        Score(
            "diverged",
            lambda track, _: track.lost is not None,
            "Lost runs: not finite, or at or beyond .1 … 10 × nominal for more than 1 s. From "
            "there on they are scored as if they sat at the farther edge of that box.",
            better="less",
            pool=pooling.count,
            heading="diverged",
            short="lost",
            kind="truth",
        ),
        Score(
            "failed",
            lambda track, _: track.failed,
            "Lost runs in which the estimator raised something or its process died; they are "
            "lost from the first sample on.",
            pool=pooling.count,
            heading="failed",
            kind="truth",
        ),
        Score("lost_at", scores.lost_at_of, "When the run was lost.", unit="s"),
        Score(
            "lost_before",
            lambda track, _: track.lost_before,
            "Whether it was lost before std and bias had been taken.",
            kind="truth",
        ),
        Score(
            "lost_after",
            lambda track, i: track.lost_by_end(i),
            "Whether it was lost before the window after the fault had ended.",
            kind="truth",
        ),
        Score(
            "never_settled",
            scores.never_settled_of,
            "Runs outside ±10 % of the fault at the end of the window, lost ones aside.",
            better="less",
            pool=pooling.count_kept,
            heading="never settled",
            short="open",
            kind="truth",
        ),
        Score(
            "lag_null",
            lambda track, i: bounds.limits_of(track, i).lag_null,
            "Lag of an estimator that never moves.",
            unit="s",
            pool=pooling.mean,
        ),
        Score(
            "lag_bound",
            lambda track, i: bounds.limits_of(track, i).lag_bound,
            "Lag that noise allows to whoever is told time and state of the jump and takes all "
            "estimated parameters, and dry friction, for unknown after it (Cramér–Rao).",
            unit="s",
            pool=pooling.mean,
        ),
        Score(
            "lag_bound_single",
            lambda track, i: bounds.limits_of(track, i).lag_bound_single,
            "The same for whoever is told besides which parameter it is, and knows the others.",
            unit="s",
            pool=pooling.mean,
        ),
        Score(
            "bound",
            lambda track, i: bounds.limits_of(track, i).bound,
            "Standard deviation on the bound with all unknown over D, by samples after onset.",
            pool=pooling.parts(AFTER, scores.rms),
            parts=dict.fromkeys(AFTER, ""),
        ),
        Score(
            "score",
            bounds.score_of,
            "0 for doing nothing, 100 for the lag of the bound with all unknown, on a logarithmic "
            "scale; for steps on an axis that a model describes.",
            unit="",
            better="more",
            pool=pooling.mean,
            heading="score",
            short="score",
        ),
        Score(
            "nees",
            consistency.nees_of,
            "Squared error before the fault in units of the claimed covariance; the number of "
            "estimated parameters for an honest claim.",
            unit="",
            pool=pooling.mean,
            heading="NEES",
        ),
        Score(
            "nis",
            consistency.nis_of,
            "Squared innovation before the fault in units of the variance claimed for it: 1 for an "
            "honest claim.",
            unit="",
            pool=pooling.mean,
            heading="NIS",
        ),
        Score(
            "whiteness",
            consistency.whiteness_of,
            "Colour of the innovations in the same time, the statistic of Ljung and Box over its "
            "degrees of freedom: 1 on average for white ones, more the more the next is known from "
            "those before.",
            unit="",
            pool=pooling.mean,
            heading="whiteness",
        ),
        Score(
            "detection",
            detection.detection_of,
            "Changes that the estimator says it found: alarms and false ones a run, false ones in "
            "1000 s, delay, share of the faults missed, share of the found ones named rightly.",
            pool=pooling.detections([*detection.ALARMS]),
            parts=detection.ALARMS,
        ),
        Score(
            "isolation", detection.isolation_of, "What each fault was taken for.", kind="text"
        ),
        Score(
            "recovered",
            recovered.recovered_of,
            "What a controller that follows the estimates recovers of what the fault costs it in "
            "rms tracking error over the same window: 0 for feed-forward that stays nominal, 100 "
            "for the same loop without the fault. Defined where the fault costs 20 % or more.",
            unit="%",
            better="more",
            pool=pooling.mean,
            heading="recovered",
            short="recov",
        ),
        Score(
            "recovered_told", recovered.recovered_told_of,
            "The same of a controller that is told the truth.", unit="%", pool=pooling.mean,
        ),
        Score(
            "tracking",
            lambda track, _: track.tracking,
            "The errors that it is made of; samples in which limits acted on what was fed forward.",
            pool=pooling.parts(recovered.PARTS, np.mean),
            parts=recovered.PARTS,
        ),
    )
}  # fmt: skip

METRICS = {score.name: score.unit or "" for score in SCORES.values() if score.compared}
"""What `compare` can compare, with units."""

MARGINS = {score.name: score.margin for score in SCORES.values() if score.margin is not None}
"""What it compares unless told otherwise, and how large a change matters (.02 is 2 %)."""


def rows(track: Track) -> list[dict[str, Any]]:
    """Return the scores of a case, a row a parameter, as they are kept."""
    return [
        {"parameter": name, "changed": bool(track.windows_of(i))}
        | {score.name: score.of(track, i) for score in SCORES.values()}
        for i, name in enumerate(track.names)
    ]


def undefined() -> dict[str, Any]:
    """Return undefined scores, for a case without a record."""
    return dict.fromkeys(("parameter", "changed", *SCORES))


def columns() -> dict[str, Kind]:
    """Return the columns of the scores in a table, by name; a part has its table's before a dot."""
    kinds: dict[str, Kind] = {}
    for score in SCORES.values():
        names = [f"{score.name}.{part}" for part in score.parts] or [score.name]
        kinds |= dict.fromkeys(names, score.kind)
    return kinds


def units() -> dict[str, str]:
    """Return the unit of each number among them; empty for a plain number."""
    of_parts = {f"{s.name}.{part}": u for s in SCORES.values() for part, u in s.parts.items()}
    plain = {s.name: s.unit or "" for s in SCORES.values() if s.kind == "number" and not s.parts}
    return of_parts | plain


def label(name: str) -> str:
    """Return a score with its unit, as for an axis.

    Examples
    --------
    >>> label("lag"), label("cross_talk"), label("excess")
    ('lag [s]', 'cross-talk [%]', 'excess error')
    """
    score = SCORES[name]
    words = score.heading or name.replace("_", " ")
    return f"{words} [{score.unit}]" if score.unit else words
