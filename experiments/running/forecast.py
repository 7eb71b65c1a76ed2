"""What a study will take, from a small part of it that is run first."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flexaxis.experiments.building.consent import names_code
from flexaxis.experiments.running.plan import Work
from flexaxis.experiments.running.units import Unit
from flexaxis.experiments.running.work import run_unit

SAMPLE = 4  # records that are run to know what one takes
SLOW = 1.0  # s of the first, after which one more has to do: nobody waits long for a forecast


@dataclass(frozen=True)
class Forecast:
    """What one process takes for a study [s], and what its rows take on the disk [bytes]."""

    seconds: float
    bytes: float

    def in_words(self, workers: int) -> str:
        """Return "about 12 min on 2 processes, 4.1 MB of rows"."""
        several = "es" if workers > 1 else ""
        return (
            f"about {duration(self.seconds / workers)} on {workers} process{several}, "
            f"{size(self.bytes)} of rows"
        )


def forecast(unit: Unit, work: Work) -> Forecast:
    """Run a small part of a unit, twice for its estimators' first start, and scale it up.

    Simulation is taken to cost by the simulated second, estimation too; estimators that differ
    from point to point are taken to cost what those of this unit do.
    """
    one = replace(unit, seeds=unit.seeds[:1])
    first = run_unit(one)
    slow = first.simulating + first.estimating > SLOW
    small = one if slow else replace(unit, seeds=unit.seeds[:SAMPLE])
    sample = run_unit(small)
    moved = len(small.seeds) * unit.variants[0].duration
    # per record, against the sample
    cases = work.cases / max(1, work.records) * len(small.seeds) / small.cases
    seconds = work.seconds * (sample.simulating + sample.estimating * cases) / moved
    return Forecast(seconds, len(sample.lines) / sample.cases * work.cases)


def without_code(unit: Unit) -> Unit | None:
    """Return a unit without the estimators that name code, None if there are no others."""
    variants = tuple(
        replace(variant, entries=tuple(e for e in variant.entries if not names_code(e.text)))
        for variant in unit.variants
    )
    kept = tuple(variant for variant in variants if variant.entries)
    return replace(unit, variants=kept) if kept else None


def duration(seconds: float) -> str:
    """Return a time in the unit that fits.

    Examples
    --------
    >>> duration(12.3), duration(150), duration(2e4), duration(3e5)
    ('12 s', '2.5 min', '5.6 h', '3.5 days')
    """
    for limit, scale, unit in ((100, 1, "s"), (5400, 60, "min"), (172800, 3600, "h")):
        if seconds < limit:
            return f"{seconds / scale:.2g} {unit}"
    return f"{seconds / 86400:.2g} days"


def size(count: float) -> str:
    """Return a number of bytes in the unit that fits.

    Examples
    --------
    >>> size(1500.0), size(3.2e9)
    ('1.5 kB', '3.2 GB')
    """
    for limit, scale, unit in ((1e6, 1e3, "kB"), (1e9, 1e6, "MB")):
        if count < limit:
            return f"{count / scale:.2g} {unit}"
    return f"{count / 1e9:.2g} GB"
