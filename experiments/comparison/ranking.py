"""Who is faster, quieter, ahead, and who cannot be told apart: from paired runs, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison.matching import MATCHED, NOISIER, QUIETER
from flexaxis.experiments.comparison.statistics import LogRatios, holm_levels, sign_p
from flexaxis.experiments.scoring.intervals import LEAST, mean_interval

Row = Mapping[str, Any]
Array = NDArray[np.float64]

REFERENCE = "rpem-forgetting"
CONTROLS = ("frozen", "oracle-reset")  # they know more than an estimator may, or nothing
AT_MOST = {QUIETER: "≤ ", NOISIER: "≥ "}
"""Sign before a lag that no setting matches; before a score it is the other way round."""
AT_LEAST = {QUIETER: "≥ ", NOISIER: "≤ ", "mixed": "about "}
LEVEL = 0.05  # chance that any of those that are equally good is wrongly told apart


Scores = Sequence[float | None]
"""A score seed by seed; None where an estimator has none, such as where it could not be run."""


def difference(first: Scores | Array, second: Scores | Array) -> LogRatios:
    """Return the paired difference first − second of two scores, on the seeds that both have."""
    d = np.array(first, float) - np.array(second, float)
    d = d[~np.isnan(d)]
    if not d.size:
        return LogRatios(0, 0.0, 0.0)
    spread = float(d.std(ddof=1)) if len(d) > 1 and np.ptp(d) > 1e-12 else 0.0
    return LogRatios(len(d), float(d.mean()), spread)


def leaders(values: Mapping[str, Scores], *, most: bool = False) -> list[str]:
    """Return the best and all that cannot be told apart from it.

    Any two are compared on the seeds that both have, and the best is who is behind the fewest: no
    mean over seeds of its own makes anybody the best. The best is found on the same seeds, so that
    any pair might be the one that is compared: k estimators share the level as all k(k−1)/2 pairs
    would (Bonferroni over the choice of the best, Holm over the rest).

    Parameters
    ----------
    values : mapping of str to sequence of float or None (n,)
        A score by name, seed by seed; less is better.
    most : bool
        Whether more is better.

    Returns
    -------
    list of str
        The best first; empty where nobody has the five seeds that it takes to be told apart.
    """
    sign = -1 if most else 1
    given = {name: sign * np.array(each, float) for name, each in values.items()}
    order = sorted(given, key=lambda name: _place(given, name))
    if not order or np.sum(~np.isnan(given[order[0]])) < LEAST:
        return []
    best, others = order[0], order[1:]
    apart = [difference(given[name], given[best]) for name in others]
    levels = holm_levels([each.p for each in apart], 2 * LEVEL / len(order))
    beside = zip(others, apart, levels, strict=True)
    return [best, *(n for n, each, level in beside if each.mean <= 0 or each.p > level)]


def _place(given: Mapping[str, Array], name: str) -> tuple[bool, int, float]:
    """Return what orders those that are compared: seeds enough, how many are ahead, the mean."""
    mine = given[name]
    ahead = sum(difference(mine, other).mean > 0 for other in given.values())
    return bool(np.sum(~np.isnan(mine)) < LEAST), ahead, float(np.nanmean(mine))


def worse(first: Row, second: Row) -> list[str]:
    """Return in words what of the first is worse than of the second, the lag aside.

    That is the standard deviation after the fault, and the number of false alarms: an estimator
    that is frozen before a fault and jumps at it is quiet only where it is measured.
    """
    found = []
    one, other = (row["values"].get("std_after") for row in (first, second))
    if one is not None and other is not None and len(one) >= LEAST:
        apart = difference(one, other)
        if apart.mean > 0 and apart.p < LEVEL:
            found.append(f"is {np.exp(apart.mean):.2g} times as noisy after the fault")
    alarms = [np.asarray(row["values"].get("false_alarms") or [0]) for row in (first, second)]
    more, less = int(np.sum(alarms[0] > alarms[1])), int(np.sum(alarms[0] < alarms[1]))
    if more > less and sign_p(more, less) < LEVEL:
        found.append(f"raises {first['false_alarms_per_1000_s']:.2g} false alarms in 1000 s")
    return found


def by_fault(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    """Return the rows of each fault, by scenario and parameter."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((row["scenario"], row["parameter"]), []).append(row)
    return found


def mark(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return the rows of a sweep with `leads`: whether a row is among the best of its fault.

    Controls do not compete, nor does who is noisier than the reference at every setting. Who is
    quieter at every setting may be quicker than what is shown, and never counts as slower.
    """
    rows = list(rows)
    ahead = {
        fault: leaders({row["estimator"]: row["values"]["lag"] for row in _compete(mine)})
        for fault, mine in by_fault(rows).items()
    }
    return [
        dict(row) | {"leads": row["estimator"] in ahead[row["scenario"], row["parameter"]]}
        for row in rows
    ]


def _compete(rows: Sequence[Row]) -> list[Row]:
    """Return who can be ranked: at equal noise, or quieter and quicker than all of these."""
    able = [r for r in rows if r["estimator"] not in CONTROLS and r["values"].get("lag")]
    matched = [row for row in able if row["how"] == MATCHED]
    best = min((row["lag"] for row in matched), default=np.inf)
    return matched + [row for row in able if row["how"] == QUIETER and row["lag"] < best]


def overall(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return one number an estimator over all faults: its mean score at equal excess error.

    Parameters
    ----------
    rows : sequence of mapping
        Of a sweep, matched on the excess error: one for each fault and estimator.

    Returns
    -------
    list of dict
        ``estimator, score, score_interval, how, faults, leads``, the best first. The set of faults
        is the same for all, those for which a bound is defined; whoever has no score at one has 0
        there. `how` is "quieter" or "noisier" where that is all that can be said at some of them
        (the score is then at least, or at most, so much), "mixed" where both occur.
    """
    faults = list(by_fault(row for row in rows if row["bound"]))
    if not faults:
        return []
    seeds = max(len(row["values"].get("score") or ()) for row in rows)
    if not seeds:
        return []
    found: dict[str, dict[str, Any]] = {}
    for estimator in dict.fromkeys(row["estimator"] for row in rows):
        own = by_fault(row for row in rows if row["estimator"] == estimator)
        mine = {fault: last for fault, (*_, last) in own.items()}
        each = [mine[f]["values"].get("score") if f in mine else None for f in faults]
        total = np.mean([values or np.zeros(seeds) for values in each], axis=0)
        how = {mine[f]["how"] for f in faults if f in mine} - {MATCHED}
        found[estimator] = {
            "estimator": estimator,
            "score": float(total.mean()),
            "score_interval": mean_interval(total),
            "how": MATCHED if not how else how.pop() if len(how) == 1 else "mixed",
            "faults": len(faults),
            "values": total.tolist(),
        }
    able = _able(found)
    ahead = leaders(able, most=True)
    order = sorted(found.values(), key=lambda entry: -entry["score"])
    return [entry | {"leads": entry["estimator"] in ahead} for entry in order]


def _able(found: Mapping[str, Row]) -> dict[str, list[float]]:
    """Return the scores of those that can be ranked, as `_compete` does."""
    others = {name: entry for name, entry in found.items() if name not in CONTROLS}
    matched = {name: e["values"] for name, e in others.items() if e["how"] == MATCHED}
    best = max((float(np.mean(values)) for values in matched.values()), default=-np.inf)
    ahead = {n: e for n, e in others.items() if e["how"] == QUIETER and e["score"] > best}
    return matched | {name: entry["values"] for name, entry in ahead.items()}


def answers(rows: Sequence[Row], words: Mapping[str, str]) -> list[str]:
    """Return for each fault who follows it fastest at equal noise, a sentence each.

    Parameters
    ----------
    rows : sequence of mapping
        As from `mark`.
    words : mapping of str to str
        What each fault is, by scenario.
    """
    found = []
    for (scenario, parameter), mine in by_fault(rows).items():
        order = sorted(_compete(mine), key=lambda row: row["lag"])
        if len(order) > 1:
            what = f"{scenario} ({words[scenario]})"
            if few := too_few(order):
                each = ", ".join(map(_lag, order))
                found.append(f"{what}: {few}; lags of {parameter}: {each}.")
                continue
            found.append(f"{what}: {_answer(order, parameter)}{_one_sided(mine)}")
    return found


def too_few(rows: Iterable[Row]) -> str:
    """Return in words that there are fewer seeds than an interval, and so a ranking, takes.

    Empty where there are enough, or no rows with a lag.
    """
    lags = [np.array(row["values"]["lag"], float) for row in rows if row["values"].get("lag")]
    seeds = max((int(np.sum(~np.isnan(lag))) for lag in lags), default=LEAST)
    are = "seed is" if seeds == 1 else "seeds are"
    return f"{seeds} {are} too few to rank: from {LEAST} on" if seeds < LEAST else ""


def _answer(order: list[Row], parameter: str) -> str:
    first = order[0]
    tied = [row for row in order[1:] if row["leads"]]
    rest = [row for row in order[1:] if not row["leads"]]
    text = f"shortest lag of {parameter}: {_lag(first)}"
    if tied:
        text += f"; these seeds cannot tell it from {', '.join(map(_lag, tied))}"
    if rest:
        text += f"; next comes {_lag(rest[0])}"
        faults = worse(first, rest[0])
        if faults:
            text += f", but {first['estimator']} {' and '.join(faults)}, so not simply better"
    for row in rest[1:]:
        if row["estimator"] == REFERENCE:
            text += f"; the paper's method, {_lag(row)}"
    return text + "."


def _lag(row: Row) -> str:
    sign = "at most " if row["how"] == QUIETER else "at least " if row["how"] == NOISIER else ""
    text = f"{row['estimator']} {sign}{row['lag']:.2g} s"
    return text + (f" ({row['over_bound']:.2g} × bound)" if row["over_bound"] else "")


def _one_sided(rows: Sequence[Row]) -> str:
    """Return a sentence for those that no setting makes as quiet, or as noisy, as the reference."""
    text = ""
    for how, side, what in ((QUIETER, "at most", "Quieter"), (NOISIER, "at least", "Noisier")):
        mine = [r for r in rows if r["how"] == how and r["estimator"] != "frozen" and r["lag"]]
        if mine:
            each = (f"{r['estimator']} (lag {side} {r['lag']:.2g} s)" for r in mine)
            text += f" {what} than the reference at every setting: {', '.join(each)}."
    return text


def in_words(rows: Sequence[Row]) -> list[str]:
    """Return for each fault who had the shortest lag as set, and whether the others were quieter.

    Parameters
    ----------
    rows : sequence of mapping
        ``scenario, parameter, estimator, lag, std, diverged, seeds`` and ``values`` of lag and
        std, seed by seed, of each estimator at the one setting it was run at.
    """
    found = []
    for fault, mine in by_fault(rows).items():
        order = sorted(mine, key=lambda row: row["lag"])
        text = f"{fault[0]}: "
        if few := too_few(mine):
            text += f"{few}; lags of {fault[1]}: {', '.join(map(_set, order))}"
        else:
            text += _as_set(order, fault[1])
        for row in order:
            if row["diverged"]:
                text += f". Of {row['seeds']} runs of {row['estimator']}, {row['diverged']} lost"
        found.append(text + ".")
    return found


def _as_set(order: Sequence[Row], parameter: str) -> str:
    """Return who had the shortest lag, who is not told from it, and how the others compare."""
    best = order[0]
    ahead = leaders({row["estimator"]: row["values"]["lag"] for row in order})
    # Who was lost in a run is not called as good as who never was, whatever the pairs can tell.
    tied = [row for row in order[1:] if row["estimator"] in ahead and not row["diverged"]]
    slower = [row for row in order[1:] if row not in tied]
    text = f"shortest lag of {parameter}: {_set(best)}"
    if tied:
        text += f"; these seeds cannot tell it from {', '.join(map(_set, tied))}"
    return text + ("; " + ", ".join(_beside(slower, best)) if slower else "")


def _set(row: Row) -> str:
    return f"{row['estimator']} {row['lag']:.2g} s at {row['std']:.2g} %"


def _beside(slower: Sequence[Row], best: Row) -> list[str]:
    """Return how the slower ones compare with the best in noise before the fault, after Holm."""
    apart = [difference(row["values"]["std"], best["values"]["std"]) for row in slower]
    levels = holm_levels([each.p for each in apart], LEVEL)
    found = []
    for row, each, level in zip(slower, apart, levels, strict=True):
        clear = each.p <= level and each.n >= LEAST
        noise = " and noisier" if each.mean > 0 else " and quieter"
        unclear = ", its noise not told apart"
        found.append(f"{_set(row)} is slower{noise if clear else unclear}")
    return found
