"""Define all scores in the table SCORES: how to compute, pool, name and display them.

Summaries, tables, reports, exports and the command `compare` use the table SCORES. Therefore one
new entry in SCORES is enough to add a score.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

from flexaxis.experiments.scoring import (
    bounds,
    consistency,
    control_benefit,
    detection,
    excess,
    pooling,
    scores,
)
from flexaxis.experiments.scoring.scores import Track

Kind = Literal["text", "number", "integer", "truth"]


@dataclass(frozen=True)
class Score:
    """Definition of one score.

    Attributes
    ----------
    name : str
        Name of the score, which is its key in rows and summaries.
    of : callable
        ``of(track, i)`` returns the score of the estimated parameter i, or None if the score is
        undefined.
    words : str
        Description of the score.
    unit : str
        Unit of the score. The unit is empty for a dimensionless number, and None for a score that
        is not a number.
    better : {"less", "more"}, optional
        Whether a smaller or a larger score is better, or None if neither is better.
    pool : callable, optional
        Function from `flexaxis.experiments.scoring.pooling`, such as ``pooling.mean`` or
        ``pooling.by(np.max)``. The call ``pool(columns, name)`` returns a dict with the pooled
        score. `pool` is None if the score is not pooled.
    heading : str
        Column heading of the score in the report, or empty if the report omits the score.
    short : str
        Column heading of the score in the terminal, or empty if the terminal table omits the score.
    kind : {"number", "integer", "truth", "text"}
        Type of the values in the column of the score.
    parts : mapping of str to str
        Unit of each number, keyed by its name, if the score consists of several numbers.
        Each part of the score has its own column.
    margin : float, optional
        Largest relative change in the score that `compare` considers negligible. By default,
        `compare` ignores scores without a margin.
    zero : float
        Smallest score that is used in ratios [unit of the score]. The command `compare` replaces
        smaller scores by `zero` before it computes ratios.
    guard : bool
        Whether the score can be negative. Ratios of scores that can be negative have no meaning, so
        `compare` uses the difference between the absolute means of the two estimators, divided by
        the standard deviation of the base estimator. For a score that can be negative, `compare`
        reports only an increase in the absolute mean.
    shared : bool
        Whether the score is the same for all parameters of a run. A shared score is computed only
        once per run.
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
    shared: bool = False

    @property
    def compared(self) -> bool:
        """Whether `compare` can use the score: `guard` is true, or smaller values are better."""
        return self.guard or (self.better == "less" and self.kind == "number")


SCORES: Mapping[str, Score] = {
    score.name: score
    for score in (
        Score(
            "lag",
            scores.lag_of,
            "Absolute relative error T Σ |θ̃|/D, integrated over the 5 s after the fault, or up to "
            "the next event if it is earlier. T is the sampling period, θ̃ is the estimation error, "
            "and D is the size of the fault. If the excitation is off when the fault occurs, the "
            "integration starts when the excitation returns. The pooled lag is the geometric mean "
            "over the runs.",
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
            "Time after which the error remains within ±10 % of the size of the fault until the "
            "end of the window. The pooled time is the median over the runs. The time is infinite "
            "for a run that diverges or never settles.",
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
            "Standard deviation of the estimation error before the fault, over time and runs. The "
            "error is evaluated over the last 5 s of excitation before the fault, or over the "
            "last 10 s of a run without a fault.",
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
            "Mean estimation error before the fault, averaged over time and runs.",
            unit="%",
            pool=pooling.mean,
            heading="bias",
            margin=0.2,
            guard=True,
        ),
        Score(
            "std_after",
            scores.std_after_of,
            "Standard deviation of the estimation error in the last 2 s of the window after the "
            "fault. A large std after a fault reveals an estimator whose std before the fault is "
            "small only because its estimates hardly change.",
            unit="%",
            better="less",
            pool=pooling.deviation("bias_after", "lost_after"),
            heading="std after",
            zero=1e-3,
        ),
        Score(
            "bias_after",
            scores.bias_after_of,
            "Mean estimation error in the last 2 s of the window after the fault.",
            unit="%",
            pool=pooling.mean,
        ),
        Score(
            "cross_talk",
            scores.cross_talk_of,
            "Root mean square error of a parameter that did not change, in the window after a "
            "fault in another parameter.",
            unit="%",
            better="less",
            pool=pooling.root_mean_square,
            heading="cross-talk",
            zero=1e-3,
        ),
        Score(
            "excess",
            excess.excess_of,
            "Relative increase in the mean squared prediction error before the fault, due to the "
            "errors θ̃ of all estimated parameters: θ̃ᵀQθ̃/σ². The excess error is the same for all "
            "parameters and does not depend on units.",
            unit="",
            better="less",
            pool=pooling.mean,
            heading="excess error",
            zero=1e-4,
            shared=True,
        ),
        Score(
            "diverged",
            lambda track, _: track.lost is not None,
            "Number of runs in which an estimate is not finite, or lies outside the range 0.1 to "
            "10 × nominal for more than 1 s. After divergence, the estimate is replaced by the "
            "limit that is farther from the true value.",
            better="less",
            pool=pooling.count,
            heading="diverged",
            short="lost",
            kind="truth",
        ),
        Score(
            "failed",
            lambda track, _: track.failed,
            "Number of runs in which the estimator raised an exception or its process died. A "
            "failed run counts as diverged from the first sample on.",
            pool=pooling.count,
            heading="failed",
            kind="truth",
        ),
        Score("lost_at", scores.lost_at_of, "Time at which the run diverged.", unit="s"),
        Score(
            "lost_before",
            lambda track, _: track.lost_before,
            "Whether the run diverged before the last sample that is used for std and bias.",
            kind="truth",
        ),
        Score(
            "lost_after",
            lambda track, i: track.lost_by_end(i),
            "Whether the run diverged before the end of the window after the fault.",
            kind="truth",
        ),
        Score(
            "never_settled",
            scores.never_settled_of,
            "Number of runs in which the error at the end of the window exceeds ±10 % of the size "
            "of the fault. Diverged runs are not counted.",
            better="less",
            pool=pooling.count_kept,
            heading="never settled",
            short="open",
            kind="truth",
        ),
        *(
            Score(name, partial(bounds.limit_of, name), words, unit="s", pool=pooling.mean)
            for name, words in bounds.LIMITS.items()
        ),
        Score(
            "score",
            bounds.score_of,
            "Lag on a logarithmic scale: 0 for an estimator with constant estimates, and 100 at "
            "the Cramér–Rao bound `lag_bound`. The score is defined for step changes in parameters "
            "if one of the estimator models describes the axis.",
            unit="",
            better="more",
            pool=pooling.mean,
            heading="score",
            short="score",
        ),
        Score(
            "nees",
            consistency.nees_of,
            "Normalised squared estimation error θ̃ᵀ Σ⁻¹ θ̃ before the fault. If the reported "
            "covariance Σ is correct, the mean NEES is the number of estimated parameters.",
            unit="",
            pool=pooling.mean,
            heading="NEES",
            shared=True,
        ),
        Score(
            "nis",
            consistency.nis_of,
            "Mean normalised squared innovation before the fault. If the innovation variance that "
            "the estimator reports is correct, the mean NIS is 1.",
            unit="",
            pool=pooling.mean,
            heading="NIS",
            shared=True,
        ),
        Score(
            "whiteness",
            consistency.whiteness_of,
            "Ljung–Box statistic of the innovations before the fault, divided by its degrees of "
            "freedom. The mean of the statistic is 1 for white innovations, and larger for "
            "correlated innovations.",
            unit="",
            pool=pooling.mean,
            heading="whiteness",
            shared=True,
        ),
        Score(
            "detection",
            detection.detection_of,
            "Fault detection by the estimator: alarms and false alarms per run, false alarms per "
            "1000 s, delay, fraction of missed faults, and fraction of detected faults that are "
            "attributed to the correct parameter.",
            pool=pooling.detections([*detection.ALARMS]),
            parts=detection.ALARMS,
            shared=True,
        ),
        Score(
            "isolation", detection.isolation_of,
            "Parameters to which the estimator attributes each fault.", kind="text", shared=True
        ),
        Score(
            "recovered",
            control_benefit.recovered_of,
            "Percentage of the fault-induced rms tracking error that a controller avoids by using "
            "the estimates. The percentage is 0 for feed-forward with nominal parameters, "
            "and 100 if the tracking error is as small as without the fault. The percentage is "
            "undefined if the fault increases the tracking error by less than 20 %.",
            unit="%",
            better="more",
            pool=pooling.mean,
            heading="recovered",
            short="recov",
        ),
        Score(
            "recovered_told", control_benefit.recovered_told_of,
            "Percentage of the fault-induced rms tracking error that a controller avoids by using "
            "the true parameters.", unit="%", pool=pooling.mean,
        ),
        Score(
            "tracking",
            lambda track, _: track.tracking,
            "Tracking errors from which the score `recovered` is computed, and the number of "
            "samples at which the feed-forward parameters were limited.",
            pool=pooling.parts(control_benefit.PARTS),
            parts=control_benefit.PARTS,
        ),
    )
}  # fmt: skip

METRICS = {score.name: score.unit or "" for score in SCORES.values() if score.compared}
"""Units of all scores that `compare` can use, keyed by score."""

MARGINS = {score.name: score.margin for score in SCORES.values() if score.margin is not None}
"""Default margins of `compare`: the largest negligible relative change in each score."""


def rows(track: Track) -> list[dict[str, Any]]:
    """Return the scores of a run as a list of rows, with one row per parameter."""
    shared = {score.name: score.of(track, 0) for score in SCORES.values() if score.shared}
    return [
        {"parameter": name, "changed": bool(track.windows_of(i))}
        | {
            name: shared[name] if name in shared else score.of(track, i)
            for name, score in SCORES.items()
        }
        for i, name in enumerate(track.names)
    ]


def undefined() -> dict[str, Any]:
    """Return a row in which all scores are None, for a run without a simulated record."""
    return dict.fromkeys(("parameter", "changed", *SCORES))


def columns() -> dict[str, Kind]:
    """Return the type of the values in each column, keyed by ``score`` or ``score.part``."""
    kinds: dict[str, Kind] = {}
    for score in SCORES.values():
        names = [f"{score.name}.{part}" for part in score.parts] or [score.name]
        kinds |= dict.fromkeys(names, score.kind)
    return kinds


def units() -> dict[str, str]:
    """Return the unit of each numeric column; the unit of a dimensionless number is empty."""
    of_parts = {f"{s.name}.{part}": u for s in SCORES.values() for part, u in s.parts.items()}
    plain = {s.name: s.unit or "" for s in SCORES.values() if s.kind == "number" and not s.parts}
    return of_parts | plain


def label(name: str) -> str:
    """Return the name of a score with its unit, for the axis of a figure.

    Examples
    --------
    >>> label("lag"), label("cross_talk"), label("excess")
    ('lag [s]', 'cross-talk [%]', 'excess error')
    """
    score = SCORES[name]
    words = score.heading or name.replace("_", " ")
    return f"{words} [{score.unit}]" if score.unit else words
