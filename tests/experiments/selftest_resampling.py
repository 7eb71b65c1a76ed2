"""Comparisons drawn from a pool of runs, and how the gate judges them, many at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.gate import decide
from flexaxis.experiments.gate.decide import BETTER, UNDECIDED, WORSE, Family, alarming, judge_lost
from flexaxis.experiments.gate.pairs import LOST, Paired

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Pool:
    """Base and candidate on a pool of seeds (N): S scores on K scenarios.

    Attributes
    ----------
    family : Family
        The scores.
    place : ndarray (S,) of int
        Which scenario each score is of.
    ratios : ndarray (S, N)
        log(candidate/base), NaN where there is no pair.
    lost : mapping of way to ndarray (2, K, N) of bool
        Runs lost by the base and by the candidate.
    """

    family: Family
    place: NDArray[np.int64]
    ratios: Array
    lost: Mapping[str, Flags]

    @staticmethod
    def of(paired: Paired, margins: Mapping[str, float]) -> Pool:
        """Return the pool of what was run; all scenarios have the same seeds."""
        scores, names = paired.scores, [runs.scenario for runs in paired.runs]
        family = Family.of(
            [s.scenario for s in scores],
            [s.metric for s in scores],
            [margins[s.metric] for s in scores],
        )
        lost = {
            way: np.array([[getattr(r, side)[way] for r in paired.runs] for side in _SIDES])
            for way in LOST
        }
        place = np.array([names.index(s.scenario) for s in scores])
        return Pool(family, place, np.array([s.changes for s in scores]), lost)


_SIDES = ("base", "candidate")


@dataclass(frozen=True, eq=False)
class Drawn:
    """C comparisons of n seeds each: `ratios` (C, S, n); `lost` by way, (2, C, K, n)."""

    family: Family
    ratios: Array
    lost: Mapping[str, Flags]


@dataclass(frozen=True, eq=False)
class Judged:
    """What the gate said of C comparisons.

    Attributes
    ----------
    word : ndarray (C,) of str
    status : ndarray (C,) of int
    worse, better : ndarray (C,) of bool
        Whether any score, or any count of lost runs, is called so.
    """

    word: NDArray[np.str_]
    status: NDArray[np.int64]
    worse: Flags
    better: Flags


def draw(
    pool: Pool,
    size: int,
    comparisons: int,
    random: np.random.Generator,
    *,
    swap: bool = False,
    lose: tuple[float, float] = (0.0, 0.0),
    way: str = "diverged",
) -> Drawn:
    """Draw comparisons, each of `size` seeds of the pool, none twice.

    Parameters
    ----------
    pool : Pool
    size, comparisons : int
    random : numpy.random.Generator
    swap : bool
        Let base and candidate change sides on each run by chance, so that neither can be better.
    lose : (float, float)
        Share of the runs of base and candidate that are lost besides, by chance.
    way : str
        In which way.
    """
    count = pool.ratios.shape[1]
    seeds = random.permuted(np.tile(np.arange(count), (comparisons, 1)), axis=1)[:, :size]
    shape = (comparisons, len(pool.lost[LOST[0]][0]), size)
    turned = random.random(shape) < 0.5 if swap else np.zeros(shape, bool)
    lost = {}
    for name, flags in pool.lost.items():
        base, candidate = np.moveaxis(flags[:, :, seeds], 1, 2)
        sides = np.where(turned, candidate, base), np.where(turned, base, candidate)
        lost[name] = np.array(sides)
    lost[way] |= np.array([random.random(shape) < share for share in lose])
    gone = np.asarray(lost["diverged"].any(axis=0))
    lost["never_settled"] &= ~gone
    ratios = np.moveaxis(pool.ratios[:, seeds], 0, 1)
    ratios = np.where(turned[:, pool.place], -ratios, ratios)
    return Drawn(pool.family, np.where(gone[:, pool.place], np.nan, ratios), lost)


def judged(drawn: Drawn, looks: Sequence[int], *, alpha: float = decide.ALPHA) -> Judged:
    """Judge each comparison as the gate does: at each look, until it is decided.

    Parameters
    ----------
    drawn : Drawn
    looks : sequence of int
        Seeds at each; the last has all.
    alpha : float
        Of the whole comparison; each look has its share.
    """
    found = _look(drawn, looks[0], alpha / len(looks))
    for seeds in looks[1:]:
        again = _look(drawn, seeds, alpha / len(looks))
        open_ = found.word == UNDECIDED
        found = Judged(
            *(
                np.where(open_, getattr(again, name), getattr(found, name))
                for name in ("word", "status", "worse", "better")
            )
        )
    return found


def _look(drawn: Drawn, seeds: int, alpha: float) -> Judged:
    words = decide.decide(drawn.ratios[:, :, :seeds], drawn.family, alpha=alpha).words
    said, counts = [], []
    for way, flags in drawn.lost.items():
        base, candidate = flags[:, :, :, :seeds]
        sides = (candidate & ~base, base & ~candidate, base)
        newly, regained, all_ = (side.sum(axis=(1, 2)) for side in sides)
        said.append(judge_lost(newly, regained, way, alpha=alpha))
        counts.append((newly, regained, all_))
    lost = np.stack(said, axis=1)
    look = alarming(*(np.stack(each, axis=-1) for each in zip(*counts, strict=True)))
    word = decide.overall(words, lost)
    every = np.concatenate([words, lost], axis=1)
    status = np.where(word == WORSE, 1, np.where((word == UNDECIDED) & look, 3, 0))
    return Judged(word, status, (every == WORSE).any(axis=1), (every == BETTER).any(axis=1))
