"""Many runs pooled into the rows of docs/glr.py; rows that are kept, and beside each other."""

import csv
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from glr_runs import AGES, Row
from scipy.stats import beta, chi2

from flexaxis.experiments.scoring.intervals import log_interval, mean_interval
from flexaxis.experiments.scoring.pooling import scatter

KEPT = Path(__file__).parent / "data" / "glr.csv"


def pooled(of: Row, runs: Sequence[Row]) -> list[Row]:
    """Return the runs of an estimator on a case as a row for each parameter that changes."""
    well = [r for r in runs if "error" not in r]
    shared = of | {"runs": len(runs), "failed": len(runs) - len(well)}
    if not well:
        return [shared | {"parameter": "", "failure": " ".join(runs[0]["error"].split())}]
    shared |= _found([f for r in well for f in r["faults"]])
    false = [moved for r in well for moved in r["false"]]
    shared |= {"false": len(false), "true": sum(false), "calm": sum(r["calm"] for r in well)}
    shared |= {"us": mean(r["us"] for r in well)}
    for i, age in enumerate(("0", *AGES)):
        known = [r["claims"][i] for r in well if r["claims"][i]]
        shared[f"nees {age}"] = mean(c["nees"] for c in known if c["nees"] is not None)
        shared |= {f"{k} {age}": sum(c[k] for c in known) for k in ("inside", "of")}
    return [shared | one for one in _parameters(runs, well)]


def _found(faults: Sequence[Row]) -> Row:
    met = [f for f in faults if "named" in f]
    sizes = [abs(f["size"]) for f in met if f.get("size") is not None]
    cover = [f["covered"] for f in met if f.get("covered") is not None]
    wrong = [f"{f['fault']}:{'+'.join(f['named'])}" for f in met if f["named"] != [f["fault"]]]
    return {"faults": len(faults), "found": len(met), "wrong": len(wrong),
            "taken": " ".join(f"{w}×{n}" for w, n in sorted(Counter(wrong).items())),
            "more": sum(f["more"] for f in faults), "delay": mean(f["delay"] for f in met),
            "size": mean(sizes), "cover": sum(cover), "covers": len(cover)}  # fmt: skip


def _parameters(runs: Sequence[Row], well: Sequence[Row]) -> Iterable[Row]:
    """Yield what is known of each parameter that changes; of the worst where none does."""
    by: dict[str, list[Row]] = {}
    for row in (row for r in well for row in r["rows"]):
        by.setdefault(row["parameter"], []).append(row)
    cross = [np.sqrt(np.mean([x["cross_talk"] ** 2 for x in xs])) for n, xs in by.items()
             if xs[0]["cross_talk"] is not None and n != "f_c"]  # fmt: skip
    shared: Row = {"cross": max(cross, default=None)}
    shared["lost"] = sum(bool(r["rows"][0]["diverged"]) for r in well)
    spread = {n: _spread(xs) for n, xs in by.items() if xs[0]["std"] is not None}
    changed = [n for n, xs in by.items() if xs[0]["changed"] and xs[0]["lag"] is not None]
    for name in changed:
        lags = [next((x["lag"] for x in r.get("rows", ()) if x["parameter"] == name), None)
                for r in runs]  # fmt: skip
        bound = mean(x["lag_bound"] for x in by[name] if (x["lag_bound"] or 0) > 0)
        yield shared | spread.get(name, {}) | {"parameter": name, "bound": bound} | of_lags(lags)
    if not changed:
        linear = [n for n in spread if n != "f_c"] or list(spread)
        worst = max(linear, key=lambda n: spread[n]["rms"], default=None)
        yield shared | (spread[worst] if worst else {}) | {"parameter": f"({worst})"}


def of_lags(lags: Sequence[float | None]) -> Row:
    """Return the geometric mean of lags, its interval, and each of them."""
    there = [x for x in lags if x is not None]
    low, high = log_interval(there) or (None, None)
    each = " ".join("-" if x is None else f"{x:.3g}" for x in lags)
    return {"lag": float(np.exp(np.mean(np.log(there)))), "low": low, "high": high, "lags": each}


def _spread(rows: Sequence[Row]) -> Row:
    """Return bias, half its interval, deviation about it and rms error before a fault [%]."""
    std, bias = (np.array([r[n] for r in rows]) for n in ("std", "bias"))
    lost = np.array([bool(r["lost_before"]) for r in rows])
    ends = mean_interval(bias)
    return {"bias": float(bias.mean()), "error": (ends[1] - ends[0]) / 2 if ends else None,
            "std": scatter(std, bias, lost), "rms": float(np.sqrt(np.mean(std**2)))}  # fmt: skip


def mean(values: Iterable[float]) -> float | None:
    """Return the mean, None of nothing."""
    found = list(values)
    return float(np.mean(found)) if found else None


def paired(row: Row, others: Sequence[Row]) -> str:
    """Return the lag of a row less that of the best other, over the bound.

    Both begin with the same seed, and are paired as far as the shorter goes.
    """
    mine = [o for o in others if o.get("lag") and o["estimator"] != row["estimator"]
            and all(o[k] == row[k] for k in ("table", "case", "parameter"))]  # fmt: skip
    if not mine or not row.get("lag"):
        return ""
    best = min(mine, key=lambda o: float(o["lag"]))
    pairs = zip(str(row["lags"]).split(), str(best["lags"]).split(), strict=False)
    apart = np.array([float(a) - float(b) for a, b in pairs if "-" not in {a, b}])
    apart /= row.get("bound") or best["lag"]
    ends = mean_interval(apart)
    return f"{apart.mean():+.2f}" + (f" ({ends[0]:+.2f} … {ends[1]:+.2f})" if ends else "")


def share(part: float, whole: float) -> str:
    """Return a count of so many, with its 95 % interval (Clopper and Pearson) [%]."""
    a, n = int(part), int(whole)
    if not n:
        return "–"
    low = beta.ppf(0.025, a, n - a + 1) if a else 0.0
    high = beta.ppf(0.975, a + 1, n - a) if a < n else 1.0
    return f"{a} of {n} ({100 * low:.0f}–{100 * high:.0f})"


def rate(events: float, seconds: float, per: float = 2000.0) -> str:
    """Return the number of events in a time, with the 95 % interval of Poisson."""
    ends = chi2.ppf(0.025, 2 * events) / 2 if events else 0.0, chi2.ppf(0.975, 2 * events + 2) / 2
    found = (per * x / max(seconds, 1e-9) for x in (events, *ends))
    return "{:.2g} ({:.2g} … {:.2g})".format(*found)


def number(value: Any, form: str = ".3g") -> str:
    """Return a number, or a dash."""
    return "–" if value in {None, ""} else f"{value:{form}}"


def stored() -> list[Row]:
    """Return the rows that were kept, of estimators that may be gone."""
    if not KEPT.exists():
        return []
    with KEPT.open(encoding="utf-8", newline="") as file:
        return [{k: _value(k, v) for k, v in row.items() if v} for row in csv.DictReader(file)]


def _value(key: str, text: str) -> Any:
    words = ("table", "case", "estimator", "parameter", "seeds", "version", "lags", "taken", "how",
             "failure")  # fmt: skip
    return text if key in words else float(text)


def first(row: Row) -> str:
    """Return the first seed of a row."""
    return str(row["seeds"]).partition(":")[0]


def keep(rows: Sequence[Row]) -> None:
    """Add rows to those that are kept, in the place of the same ones with no more seeds."""
    of = ("table", "case", "estimator", "parameter")
    found = sorted([*stored(), *rows], key=lambda r: float(r["runs"]))
    whole = {(*(r[k] for k in of), first(r)): r for r in found}
    columns = list(dict.fromkeys(k for r in whole.values() for k in r))
    KEPT.parent.mkdir(exist_ok=True)
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        for row in whole.values():
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
