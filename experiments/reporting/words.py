"""The sentences of reports: what a fault is, who is fastest by how much, what must not be missed.

All of them are computed. Terminal and page use the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from flexaxis.experiments.comparison.ranking import CONTROLS, REFERENCE, too_few
from flexaxis.experiments.reporting.tables import between, short

Row = Mapping[str, Any]

PARAMETERS = {
    "k_T": "torque constant",
    "J_m": "motor inertia",
    "J_g": "gear inertia",
    "J_a": "arm inertia",
    "J_l": "load inertia",
    "k_g": "gear stiffness",
    "k_a": "arm stiffness",
    "d_g": "gear damping",
    "d_a": "arm damping",
    "f_m": "motor friction",
    "f_g": "gear friction",
    "f_a": "arm friction",
    "f_c": "dry friction",
    "r": "gear ratio",
}
BESIDE = {
    "friction": "dry friction",
    "lugre": "dry friction",
    "static_friction": "measured friction",
    "gear_friction": "friction of the gear",
    "backlash": "backlash",
    "cogging": "cogging",
    "stiffening": "a stiffening gear",
}
KINDS = {"ramp": ", gradually", "thermal": ", slowly", "intermittent": ", now and then"}
BIASED = 10.0  # bias [% of nominal] from which an estimate is called wrong


def listed(names: Sequence[str]) -> str:
    """Return names as a list in a sentence.

    Examples
    --------
    >>> listed(["glr", "imm", "ekf"]), listed(["glr"])
    ('glr, imm and ekf', 'glr')
    """
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def change(fault: Row) -> str:
    """Return a fault in words.

    Examples
    --------
    >>> change({"parameter": "k_T", "factor": 0.9, "kind": "step"})
    'torque constant −10 %'
    """
    name, factor = PARAMETERS.get(fault["parameter"], fault["parameter"]), fault["factor"]
    size = f"× {factor:g}" if factor >= 4 else f"{100 * (factor - 1):+.0f} %".replace("-", "−")
    return f"{name} {size}{KINDS.get(fault['kind'], '')}"


def unmodelled(definition: Row) -> str:
    """Return what an axis has that the linear model lacks, as a list; empty if nothing."""
    return listed(list(dict.fromkeys(BESIDE[key] for key in BESIDE if definition.get(key))))


def happens(definition: Row) -> str:
    """Return what happens in a scenario, such as "motor friction +50 %, beside dry friction"."""
    faults = ", ".join(map(change, definition.get("fault") or ())) or "no fault"
    beside, encoder = unmodelled(definition), (definition.get("encoder") or {}).get("counts")
    return f"{faults}{f', beside {beside}' * bool(beside)}{', by encoder' * bool(encoder)}"


def order_of(summary: Row) -> list[str]:
    """Return the estimators of a run in the order of its ranking, others behind."""
    ranked = (summary.get("tradeoff") or {}).get("overall", ())
    return list(dict.fromkeys([*(row["estimator"] for row in ranked), *summary["estimators"]]))


def faults_of(rows: Sequence[Row]) -> pd.DataFrame:
    """Return rows of a sweep as a DataFrame, with the name of their `fault`."""
    found = pd.DataFrame(rows)
    if rows:
        found["fault"] = found["scenario"] + ": " + found["parameter"]
        found["lag"] = found["lag"].astype(float)
    return found


def fault_words(swept: Row) -> dict[str, str]:
    """Return what the faults of a sweep are called, by name."""
    definitions, rows = swept["definitions"], swept["matched"]
    return {f"{r['scenario']}: {r['parameter']}": happens(definitions[r["scenario"]]) for r in rows}


def widest(matched: pd.DataFrame) -> str:
    """Return the fault at which the lags of estimators at equal noise differ most."""
    lags = matched.groupby("fault")["lag"].agg(["max", "min"])
    return str((lags["max"] / lags["min"]).fillna(0).idxmax())


def answer(summary: Row) -> tuple[str, list[str]]:
    """Return the answer of a run in a sentence, and what stands below it, a sentence a fact."""
    rows = [row for row in (summary.get("tradeoff") or {}).get("matched", ())
            if row["estimator"] not in CONTROLS]  # fmt: skip
    matched, seeds = faults_of(rows), len(summary["seeds"])
    if not rows or (few := too_few(rows)):
        return f"{summary['title']}: {few if rows else 'nothing was compared at equal noise'}", []
    if matched["lag"].isna().all():
        return "No estimator survived: every run was lost", []
    near = matched.groupby("estimator")["over_bound"].agg(between)
    takes = "{} takes {} times the shortest lag that theory allows".format
    if len(near) == 1:
        return takes(near.index[0], near.iloc[0]), []
    wins = matched.groupby("estimator")["leads"].sum()
    first = [name for name in order_of(summary) if wins.get(name) == wins.max() > 0]
    if not first or len(first) == len(near):
        return f"{seeds} seeds cannot tell the estimators apart", []
    faults = matched["fault"].nunique()
    where = f"in {wins.max()} of {faults} faults"
    same = f" (no significant difference, {seeds} seeds)" * (len(first) > 1)
    ties = [f" {who} ties in {n} of {faults}." for who, n in wins.items()
            if n and who not in first]  # fmt: skip
    fact = (
        f"Fastest{f' {where}' * bool(wins.max() < faults)}: {listed(first)}{same}.{''.join(ties)}"
    )
    far = takes(first[0], near[first[0]])
    if REFERENCE in near and REFERENCE not in first:
        far += f"; {REFERENCE}, the paper’s method, {near[REFERENCE]} times"
    return _title(matched, first, where), [fact, f"{far}."]


def _title(matched: pd.DataFrame, first: Sequence[str], where: str) -> str:
    """Return how many times faster than the reference some estimators are, or that they lead."""
    lags = matched[matched["how"] == "matched"].pivot(
        index="estimator", columns="fault", values="lag"
    )
    lags, one = lags.reindex([REFERENCE, *first]), len(first) == 1
    ratios = (lags.iloc[0] / lags.iloc[1:]).stack().dropna()
    if ratios.empty or ratios.min() < 1.05:  # also where the reference itself leads
        return f"{listed(first)} {'is' if one else 'are'} fastest {where}, at equal noise"
    ends = dict.fromkeys(f"{r:.0f}" if r >= 3 else short(r) for r in (ratios.min(), ratios.max()))
    times = f"{' to '.join(ends)} times faster than {REFERENCE}, at equal noise"
    return f"{listed(first)} track{'s' * one} a fault {times}"


def warning(rows: Sequence[Row], scenarios: Mapping[str, Row]) -> tuple[str, str] | None:
    """Return the one line not to be missed, and its scenario.

    It is of the scenario in which the largest share of the estimators is biased or lost.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled, at default settings.
    scenarios : mapping of str to mapping
        With their `definition`.
    """
    able = pd.DataFrame([r for r in rows if r["changed"] and r["estimator"] not in CONTROLS])
    if able.empty:
        return None
    off = able["bias"].astype(float).abs()
    able = able.assign(off=off.where(off > BIASED))
    able["bad"] = able["off"].notna() | (able["diverged"] > 0)
    name = able.groupby("scenario", sort=False)["bad"].mean().idxmax()
    here, definition = able[able["scenario"] == name], scenarios[str(name)]["definition"]
    bad, good = (here[here["bad"] == side]["estimator"].tolist() for side in (True, False))
    if not bad:
        return None
    every = len(good) < 3 <= len(bad) or not good
    who = f"every estimator{f' but {listed(good)}' * bool(good)}" if every else listed(bad)
    beside, lost = unmodelled(definition), here["diverged"].sum()
    where = f"{beside} that the model lacks" if beside else happens(definition)
    what = [f"off by {between(here['off'])} % even before the fault"] * bool(here["off"].any())
    what += [f"lost in {lost} of {here['seeds'].sum()} runs"] * bool(lost)
    verb = "is" if every or len(bad) == 1 else "are"
    return f"With {where}, {who} {verb} {listed(what)} (default settings).", str(name)


def failures_in_words(failures: Sequence[Row]) -> list[tuple[str, int]]:
    """Return a sentence for each kind of failure, and how many cases failed like that.

    Parameters
    ----------
    failures : sequence of mapping
        With `scenario`, `estimator`, `seed` and `error`.
    """
    kinds: dict[str, list[str]] = {}
    for row in failures:
        where = f"{row['scenario']}, seed {row['seed']}"
        alike = re.sub(r", sample \d+( \([^)]*\))?", "", row["error"].replace(where, ""))[:60]
        text = f"{row['estimator']} failed on {where}: {row['error']}"
        kinds.setdefault(row["estimator"] + alike, []).append(text)
    return [(texts[0], len(texts)) for texts in kinds.values()]


AXES = {
    "factor": "{} after the fault / before",
    "at": "time of the fault [s]",
    "over": "time over which {} changes [s]",
    "duration": "length of the run [s]",
    "period": "sampling period [s]",
    "start": "first estimate / nominal",
    "noise.speed": "noise of the speed, 1σ [rad/s]",
    "noise.angle": "noise of the angle, 1σ [rad]",
    "encoder.counts": "counts of the encoder in a turn",
    "delay.measurement": "delay of the measurement [samples]",
    "controller.Kv": "speed gain [N m s/rad]",
    "excitation.high": "upper end of the excitation [Hz]",
    "excitation.rms": "size of the reference, rms [rad]",
    "friction.coulomb": "Coulomb friction [N m]",
    "backlash.gear": "gap of the gear [rad]",
    "cogging.amplitude": "cogging, amplitude [N m]",
    "saturation.torque": "limit of the torque [N m]",
    "forgetting": "forgetting factor λ",
    "drift": "size of the drift Δ",
}
"""What swept keys are called; the other keys stand as they are."""


def axis_words(key: str, study: Row) -> str:
    """Return what a swept key is called, with its unit where it is one of `AXES`.

    Parameters
    ----------
    key : str
        Such as ``"fault[0].factor"`` or ``"rpem-forgetting.forgetting"``.
    study : mapping
        With the definitions of its scenarios.

    Examples
    --------
    >>> axis_words("noise.speed", {}), axis_words("controller.Ki", {})
    ('noise of the speed, 1σ [rad/s]', 'controller.Ki')
    """
    table, _, name = key.rpartition(".")
    text = AXES.get(key) or (
        AXES.get(name, key) if re.match("fault|estimator|rpem", table) else key
    )
    faults = [s["definition"].get("fault") or [{}] for s in study.get("scenarios", ())]
    names = {PARAMETERS.get(fault[0].get("parameter"), "parameter") for fault in faults}
    return text.format(listed(sorted(names)))
