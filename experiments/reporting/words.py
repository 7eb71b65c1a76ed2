"""The sentences of reports: faults, the fastest estimator, and warnings.

All of them are computed. Terminal and page use the same.
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
    "gear_friction": "friction of the gear",
    "backlash": "backlash",
    "cogging": "cogging",
    "stiffening": "a stiffening gear",
}
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
    >>> change({"parameter": "k_T", "factor": 0.9, "kind": "ramp"})
    'torque constant −10 %, ramp'
    """
    name, size = fault["parameter"], f"{100 * (fault['factor'] - 1):+.0f} %".replace("-", "−")
    kind = "" if fault["kind"] == "step" else f", {fault['kind']}"
    return f"{PARAMETERS.get(name, name)} {size}{kind}"


def unmodelled(definition: Row) -> str:
    """Return the nonlinear effects of an axis as a list."""
    return listed([BESIDE[key] for key in BESIDE if definition.get(key)])


def happens(definition: Row) -> str:
    """Return the events of a scenario, such as "motor friction +50 %, beside dry friction"."""
    faults = ", ".join(map(change, definition.get("fault") or ())) or "no fault"
    beside = unmodelled(definition)
    return f"{faults}, beside {beside}" if beside else faults


def order_of(summary: Row) -> list[str]:
    """Return the estimators of a run in the order of its ranking, others behind."""
    ranked = [row["estimator"] for row in (summary.get("tradeoff") or {}).get("overall", ())]
    return list(dict.fromkeys([*ranked, *summary["estimators"]]))


def fault_words(swept: Row) -> dict[str, str]:
    """Return the descriptions of the faults of a sweep, by name."""
    definitions, rows = swept["definitions"], swept["matched"]
    return {f"{r['scenario']}: {r['parameter']}": happens(definitions[r["scenario"]]) for r in rows}


def answer(summary: Row) -> tuple[str, list[str]]:
    """Return the main result of a run in a sentence, and further results in one sentence each."""
    rows = [row for row in (summary.get("tradeoff") or {}).get("matched", ())
            if row["estimator"] not in CONTROLS]  # fmt: skip
    few = too_few(rows) if rows else "nothing was compared at equal noise"
    if few:
        return f"{summary['title']}: {few}", []
    matched = faults_of(rows)
    if matched["lag"].isna().all():
        return "No estimator survived: every run was lost", []
    near = matched.groupby("estimator")["over_bound"].agg(between)
    takes = "{} takes {} times the shortest lag that theory allows".format
    if len(near) == 1:
        return takes(near.index[0], near.iloc[0]), []
    wins, faults = matched.groupby("estimator")["leads"].sum(), matched["fault"].nunique()
    first = [name for name in order_of(summary) if wins.get(name) == wins.max() > 0]
    if not first or len(first) == len(near):
        return f"{len(summary['seeds'])} seeds cannot tell the estimators apart", []
    where = f"in {wins.max()} of {faults} faults"
    names = dict.fromkeys([*first, *near.index.intersection([REFERENCE])])
    return _title(matched, first, where), [f"{takes(who, near[who])}." for who in names]


def _title(matched: pd.DataFrame, first: Sequence[str], where: str) -> str:
    """Return how many times faster than the reference some estimators are, or that they lead."""
    equal = matched[matched["how"] == "matched"]
    lags = equal.pivot_table("lag", "estimator", "fault").reindex([REFERENCE, *first])
    ratios = (lags.iloc[0] / lags.iloc[1:]).stack()
    if not ratios.min() >= 1.05:  # also where the reference itself leads
        return f"{listed(first)} lead{'s' * (len(first) == 1)} {where}, at equal noise"
    ends = dict.fromkeys(f"{r:.0f}" if r >= 3 else short(r) for r in (ratios.min(), ratios.max()))
    times = f"{' to '.join(ends)} times faster than {REFERENCE}, at equal noise"
    return f"{listed(first)} track{'s' * (len(first) == 1)} a fault {times}"


def warning(rows: Sequence[Row], scenarios: Mapping[str, Row]) -> tuple[str, str] | None:
    """Return the one line not to be missed, and its scenario.

    It is of the scenario in which the largest share of the estimators is biased.

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
    able["off"] = able["bias"].astype(float).abs()
    able["bad"] = able["off"] > BIASED
    name = str(able.groupby("scenario", sort=False)["bad"].mean().idxmax())
    here, definition = able[able["scenario"] == name], scenarios[name]["definition"]
    bad, good = (here.loc[here["bad"] == side, "estimator"].tolist() for side in (True, False))
    if not bad:
        return None
    every = len(good) < 3 <= len(bad)
    who = f"every estimator{f' but {listed(good)}' * bool(good)}" if every else listed(bad)
    beside = unmodelled(definition)
    where = f"{beside} that the model lacks" if beside else happens(definition)
    bias = f"biased by {between(here.loc[here['bad'], 'off'])} % even before the fault"
    return f"With {where}, the estimates of {who} are {bias} (default settings).", name


def failures_in_words(failures: Sequence[Row]) -> list[tuple[str, int]]:
    """Return the first failure of each estimator in a sentence, and how many cases failed.

    Parameters
    ----------
    failures : sequence of mapping
        With `scenario`, `estimator`, `seed` and `error`.
    """
    texts: dict[str, list[str]] = {}
    for row in failures:
        text = f"{row['estimator']} failed on {row['scenario']}, seed {row['seed']}: {row['error']}"
        texts.setdefault(row["estimator"], []).append(text)
    return [(own[0], len(own)) for own in texts.values()]


AXES = {
    "factor": "parameter after the fault / before",
    "at": "time of the fault [s]",
    "over": "time over which the parameter changes [s]",
    "duration": "length of the run [s]",
    "period": "sampling period [s]",
    "start": "first estimate / nominal",
    "noise.speed": "noise of the speed, 1σ [rad/s]",
    "noise.angle": "noise of the angle, 1σ [rad]",
    "encoder.counts": "counts of the encoder in a turn",
    "excitation.high": "upper end of the excitation [Hz]",
    "excitation.rms": "size of the reference, rms [rad]",
    "friction.coulomb": "Coulomb friction [N m]",
    "backlash.gear": "gap of the gear [rad]",
    "forgetting": "forgetting factor λ",
    "drift": "size of the drift Δ",
}
"""What swept keys are called; the other keys stand as they are."""


def axis_words(key: str) -> str:
    """Return the name of a swept key, with its unit if it is one of `AXES`.

    Parameters
    ----------
    key : str
        Such as ``"fault[0].factor"`` or ``"rpem-forgetting.forgetting"``.

    Examples
    --------
    >>> axis_words("noise.speed"), axis_words("fault[0].factor"), axis_words("controller.Ki")
    ('noise of the speed, 1σ [rad/s]', 'parameter after the fault / before', 'controller.Ki')
    """
    return AXES.get(key) or AXES.get(key.rpartition(".")[2], key)
