"""What a deadline of a step does: to the longest step, and to when findings come."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.experiments.building.offering import keywords
from flexaxis.experiments.building.specs import build, parse, piped
from flexaxis.experiments.speed.steps import WITH_DEADLINE, time_steps, warm
from flexaxis.experiments.speed.streams import axis_of, make_stream
from flexaxis.sim.errors import FlexaxisError

NEAR = 100  # samples between the onsets of two findings that may be of one change


@dataclass(frozen=True)
class Run:
    """A run with or without a deadline.

    Attributes
    ----------
    longest : float
        Its longest step in processor time [µs].
    claims : int or None
        First sample at which it claims a covariance.
    findings : sequence
        What it has found.
    """

    longest: float
    claims: int | None
    findings: Sequence[Any]


def deadline(
    seconds: float, seeds: Sequence[int], estimators: Sequence[str] = ()
) -> Iterator[dict[str, Any]]:
    """Yield a row for each estimator.

    Parameters
    ----------
    seconds : float
        The deadline [s].
    seeds : sequence of int
        Each is a lap of an axis with a change every five seconds.
    estimators : sequence of str
        As an `--estimator` option names them; those that take a deadline by default.

    Yields
    ------
    dict
        ``estimator, deadline, steps``; ``longest_us, longest_with_us``: longest step without and
        with it, in processor time; ``findings, findings_with``; ``alike``: those that are found
        with it too, ``later_median, later_max``: their alarms later by so many samples;
        ``claim, claim_with``: first sample with a covariance, the latest over the seeds.

    Raises
    ------
    FlexaxisError
        If one takes no deadline, or has one.
    """
    names = estimators or WITH_DEADLINE
    limits = [with_deadline(name, seconds) for name in names]  # before anything is run
    for name, limited_name in zip(names, limits, strict=True):
        runs = [_both(name, limited_name, seed) for seed in seeds]
        without, limited = zip(*(both for both, _ in runs), strict=True)
        later = [k for pair in zip(without, limited, strict=True) for k in _later(*pair)]
        yield {
            "estimator": name,
            "deadline": seconds,
            "steps": sum(samples for _, samples in runs),
            "longest_us": max(run.longest for run in without),
            "longest_with_us": max(run.longest for run in limited),
            "findings": sum(len(run.findings) for run in without),
            "findings_with": sum(len(run.findings) for run in limited),
            "alike": len(later),
            "later_median": float(np.median(later)) if later else None,
            "later_max": max(later, default=None),
            "claim": _latest(without),
            "claim_with": _latest(limited),
        }


def with_deadline(text: str, seconds: float) -> str:
    """Return an estimator's text with a deadline [s] among its options.

    Raises
    ------
    FlexaxisError
        If it takes none, or has one.

    Examples
    --------
    >>> with_deadline("relocate[gain=0.5]", 0.001)
    'relocate[gain=0.5, deadline=0.001]'
    """
    spec = parse(text)
    if piped(text) or "deadline" not in keywords(spec.make):
        raise FlexaxisError(
            f"{text} takes no deadline; of ours these do: {', '.join(WITH_DEADLINE)}"
        )
    if "deadline" in spec.options:
        raise FlexaxisError(f"{text} has a deadline already: leave it out, --deadline gives one")
    name, _, options = text.partition("[")
    inside = options.strip().removesuffix("]").strip().removesuffix(",")
    return f"{name.strip()}[{inside}{', ' if inside else ''}deadline={seconds!r}]"


def _both(name: str, limited: str, seed: int) -> tuple[list[Run], int]:
    """Return the run without and the one with a deadline, and their samples."""
    axis = axis_of(name)
    stream = make_stream(axis, seed=seed)
    found = []
    for text in (name, limited):
        estimator: Any = build(parse(text), stream.scenario)
        warm(estimator, axis)
        claiming = _Claiming(estimator)
        cpu, _ = time_steps(claiming, stream, len(stream.u))
        found.append(
            Run(1e-3 * float(cpu.max()), claiming.first, getattr(estimator, "findings", ()))
        )
    return found, len(stream.u)


class _Claiming:
    """An estimator, of which is told when it first claims a covariance."""

    def __init__(self, estimator: Any) -> None:
        self._estimator, self._count = estimator, 0
        self.first: int | None = None

    def step(self, u: float, y: float | None) -> Any:
        theta = self._estimator.step(u, y)
        P = getattr(self._estimator, "covariance", None)
        if self.first is None and P is not None and np.all(np.diag(P) > 0):
            self.first = self._count
        self._count += 1
        return theta


def _later(without: Run, limited: Run) -> Iterator[int]:
    """Yield how much later the alarm came, of each finding that both have."""
    for one in without.findings:
        for other in limited.findings:
            if one.parameters == other.parameters and abs(one.onset - other.onset) <= NEAR:
                yield int(other.alarm - one.alarm)
                break


def _latest(runs: Sequence[Run]) -> int | None:
    claims = [run.claims for run in runs if run.claims is not None]
    return max(claims, default=None)
