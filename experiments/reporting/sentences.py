"""Write the report sentences on faults, on the fastest estimator and on biased estimates.

The module computes every sentence from the results. The terminal and the report pages use the same
sentences.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from flexaxis.experiments.comparison.ranking import CONTROLS, REFERENCE, faults_of, too_few
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
    "gear_friction": "gear friction",
    "backlash": "backlash",
    "cogging": "cogging",
    "stiffening": "a stiffening gear",
}
BIASED = 10.0  # an estimate is called biased if its bias exceeds this limit [% of nominal]


def listed(names: Sequence[str]) -> str:
    """Join names with commas and "and", for use in a sentence.

    Examples
    --------
    >>> listed(["glr", "imm", "ekf"]), listed(["glr"])
    ('glr, imm and ekf', 'glr')
    """
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def change(fault: Row) -> str:
    """Return a description of a fault.

    Examples
    --------
    >>> change({"parameter": "k_T", "factor": 0.9, "kind": "ramp"})
    'torque constant −10 %, ramp'
    """
    name, size = fault["parameter"], f"{100 * (fault['factor'] - 1):+.0f} %".replace("-", "−")
    kind = "" if fault["kind"] == "step" else f", {fault['kind']}"
    return f"{PARAMETERS.get(name, name)} {size}{kind}"


def unmodelled(definition: Row) -> str:
    """Return the nonlinear effects of an axis as text, such as "cogging and backlash"."""
    return listed([BESIDE[key] for key in BESIDE if definition.get(key)])


def happens(definition: Row) -> str:
    """Describe a scenario in words such as "motor friction +50 %, with dry friction"."""
    faults = ", ".join(map(change, definition.get("fault") or ())) or "no fault"
    beside = unmodelled(definition)
    return f"{faults}, with {beside}" if beside else faults


def order_of(summary: Row) -> list[str]:
    """Return the estimators of a run, sorted by rank, with unranked estimators last."""
    ranked = [row["estimator"] for row in (summary.get("tradeoff") or {}).get("overall", ())]
    return list(dict.fromkeys([*ranked, *summary["estimators"]]))


def fault_words(swept: Row) -> dict[str, str]:
    """Return descriptions of the faults in the comparison at equal noise.

    Each key consists of the scenario name and the parameter name.
    """
    definitions, rows = swept["definitions"], swept["matched"]
    return {f"{r['scenario']}: {r['parameter']}": happens(definitions[r["scenario"]]) for r in rows}


def answer(summary: Row) -> tuple[str, list[str]]:
    """Return one sentence with the main result of a run, and a list of further results."""
    rows = [row for row in (summary.get("tradeoff") or {}).get("matched", ())
            if row["estimator"] not in CONTROLS]  # fmt: skip
    few = too_few(rows) if rows else "no estimators were compared at equal noise"
    if few:
        return f"{summary['title']}: {few}", []
    matched = faults_of(rows)
    if matched["lag"].isna().all():
        return "Every run of every estimator diverged", []
    near = matched.groupby("estimator")["over_bound"].agg(between)
    takes = "The lag of {} is {} times the Cramér–Rao bound".format
    if len(near) == 1:
        return takes(near.index[0], near.iloc[0]), []
    wins, faults = matched.groupby("estimator")["leads"].sum(), matched["fault"].nunique()
    first = [name for name in order_of(summary) if wins.get(name) == wins.max() > 0]
    if not first or len(first) == len(near):
        return f"The estimators do not differ significantly over {len(summary['seeds'])} seeds", []
    where = f"for {wins.max()} of {faults} faults"
    names = dict.fromkeys([*first, *near.index.intersection([REFERENCE])])
    return _title(matched, first, where), [f"{takes(who, near[who])}." for who in names]


def _title(matched: pd.DataFrame, first: Sequence[str], where: str) -> str:
    """Return a sentence that compares the leading estimators with the reference estimator."""
    equal = matched[matched["how"] == "matched"]
    lags = equal.pivot_table("lag", "estimator", "fault").reindex([REFERENCE, *first])
    ratios = (lags.iloc[0] / lags.iloc[1:]).stack()
    if not ratios.min() >= 1.05:  # also the case if the reference is among the leading estimators
        return f"{listed(first)} lead{'s' * (len(first) == 1)} {where}, at equal noise"
    ends = dict.fromkeys(f"{r:.0f}" if r >= 3 else short(r) for r in (ratios.min(), ratios.max()))
    times = f"{' to '.join(ends)} times faster than {REFERENCE}, at equal noise"
    return f"{listed(first)} track{'s' * (len(first) == 1)} a fault {times}"


def warning(rows: Sequence[Row], scenarios: Mapping[str, Row]) -> tuple[str, str] | None:
    """Return a warning about biased estimates, and the name of the scenario that it concerns.

    The warning concerns the scenario in which the largest fraction of estimators is biased.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled scores of estimators with default settings.
    scenarios : mapping of str to mapping
        Entries of summary.json with the `definition` of each scenario, keyed by scenario name.

    Returns
    -------
    (str, str) or None
        The warning and the name of the scenario, or None if no estimate is biased.
    """
    able = pd.DataFrame([r for r in rows if r["changed"] and r["estimator"] not in CONTROLS])
    if able.empty:
        return None
    able["off"] = able["bias"].astype(float).abs()
    able["bad"] = able["off"] > BIASED
    name = str(able.groupby("scenario", sort=False)["bad"].mean().idxmax())
    here, definition = able[able["scenario"] == name], scenarios[name]["definition"]
    bad, good = (here.loc[here["bad"] == side, "estimator"].tolist() for side in (True, False))
    if not bad:
        return None
    every = len(good) < 3 <= len(bad)
    who = f"every estimator{f' except {listed(good)}' * bool(good)}" if every else listed(bad)
    beside = unmodelled(definition)
    where = f"{beside} that the model lacks" if beside else happens(definition)
    bias = f"biased by {between(here.loc[here['bad'], 'off'])} % even before the fault"
    return f"With {where}, the estimates of {who} are {bias} (default settings).", name


def failures_in_words(failures: Sequence[Row]) -> list[tuple[str, int]]:
    """Return, for each estimator, a sentence on its first failure and its number of failures.

    Parameters
    ----------
    failures : sequence of mapping
        Failed runs. Each mapping contains `scenario`, `estimator`, `seed` and `error`.
    """
    texts: dict[str, list[str]] = {}
    for row in failures:
        text = f"{row['estimator']} failed on {row['scenario']}, seed {row['seed']}: {row['error']}"
        texts.setdefault(row["estimator"], []).append(text)
    return [(own[0], len(own)) for own in texts.values()]


AXES = {
    "factor": "fault factor (new / old value)",
    "at": "time of the fault [s]",
    "over": "duration of the parameter change [s]",
    "duration": "length of the run [s]",
    "period": "sampling period [s]",
    "start": "initial estimate / nominal value",
    "noise.speed": "rms speed noise [rad/s]",
    "noise.angle": "rms angle noise [rad]",
    "encoder.counts": "encoder counts per turn",
    "excitation.high": "highest excitation frequency [Hz]",
    "excitation.rms": "rms reference angle [rad]",
    "friction.coulomb": "Coulomb friction [N m]",
    "backlash.gear": "gear backlash [rad]",
    "forgetting": "forgetting factor λ",
    "drift": "size of the drift Δ",
}
"""Axis labels of swept settings, with units."""


def axis_words(key: str) -> str:
    """Return the axis label of a swept setting, or the key of the setting if no label exists.

    Parameters
    ----------
    key : str
        Key of a swept setting, such as ``"fault[0].factor"``.

    Examples
    --------
    >>> axis_words("noise.speed"), axis_words("fault[0].factor"), axis_words("controller.Ki")
    ('rms speed noise [rad/s]', 'fault factor (new / old value)', 'controller.Ki')
    """
    return AXES.get(key) or AXES.get(key.rpartition(".")[2], key)
