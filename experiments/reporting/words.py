"""The sentences of reports: what a fault is, who is fastest by how much, what must not be missed.

All of them are computed. Terminal and page use the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.comparison.ranking import CONTROLS, REFERENCE, too_few
from flexaxis.experiments.reporting.tables import between, short
from flexaxis.experiments.running.study import ALL
from flexaxis.sim.law_parameters import LAW_UNITS
from flexaxis.sim.parameters import PARAMETER_UNITS

Row = Mapping[str, Any]
Definition = Mapping[str, Any]

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
    >>> change({"parameter": "k_T", "factor": 0.9, "kind": "step"})
    'torque constant −10 %'
    """
    name, factor = PARAMETERS.get(fault["parameter"], fault["parameter"]), fault["factor"]
    size = f"× {factor:g}" if factor >= 4 else f"{100 * (factor - 1):+.0f} %".replace("-", "−")
    how = {
        "step": "",
        "ramp": f" over {fault.get('over', 0):g} s",
        "thermal": ", slowly",
        "intermittent": ", intermittent",
        "profile": " along a profile",
    }
    return f"{name} {size}{how.get(fault.get('kind', 'step'), '')}"


def unmodelled(definition: Definition) -> str:
    """Return what an axis has that the linear model lacks, as a list; empty if nothing."""
    names = [words for key, words in BESIDE.items() if definition.get(key)]
    return listed(list(dict.fromkeys(names)))


def happens(definition: Definition) -> str:
    """Return what happens in a scenario, such as "motor friction +50 %, beside dry friction"."""
    words = ", ".join(change(fault) for fault in definition.get("fault") or ()) or "no fault"
    beside = unmodelled(definition)
    words += f", beside {beside}" if beside else ""
    return words + ", by encoder" * bool((definition.get("encoder") or {}).get("counts"))


def fault_names(rows: Sequence[Row]) -> list[str]:
    """Return the name of the fault of each row: its scenario, and what changes if several do."""
    several: dict[str, set[str]] = {}
    for row in rows:
        several.setdefault(row["scenario"], set()).add(row["parameter"])
    return [
        f"{row['scenario']}: {row['parameter']}"
        if len(several[row["scenario"]]) > 1
        else row["scenario"]
        for row in rows
    ]


def faults_of(rows: Sequence[Row]) -> pd.DataFrame:
    """Return rows of a sweep as a DataFrame with `fault`, numbers as floats."""
    table = pd.DataFrame(rows)
    if table.empty:
        return table
    columns = ("lag", "bound", "over_bound", "std", "lag_bound", "lag_bound_single")
    kinds = {name: float for name in columns if name in table}
    return table.astype(kinds).assign(fault=fault_names(rows))


def order_of(summary: Row) -> list[str]:
    """Return the estimators of a run in the order of its ranking, others behind."""
    swept = summary.get("tradeoff") or {"overall": [], "points": [], "matched": []}
    names = [row["estimator"] for part in ("overall", "points", "matched") for row in swept[part]]
    return list(dict.fromkeys([*names, *summary["estimators"]]))


def leading(matched: pd.DataFrame, order: Sequence[str]) -> tuple[list[str], int]:
    """Return who is fastest, or tied, in most faults, and in how many; nobody if all are."""
    count = matched[matched["leads"]].groupby("estimator").size()
    first = [name for name in order if count.get(name, 0) == count.max()] if len(count) else []
    everyone = len(first) == matched["estimator"].nunique()
    return ([], 0) if everyone or not first else (first, int(count.max()))


def widest(matched: pd.DataFrame) -> str:
    """Return the fault at which the lags of estimators at equal noise differ most."""
    lags = matched.pivot(index="fault", columns="estimator", values="lag")
    return str((lags.max(axis=1) / lags.min(axis=1)).fillna(0).idxmax())


def noise_of(points: pd.DataFrame) -> dict[str, float]:
    """Return the std of the reference at its default by fault; the median of all without it."""
    usual = points[(points["estimator"] == REFERENCE) & (points["factor"] == 1)]
    median = points.groupby("fault")["std"].median().to_dict()
    return median | usual.set_index("fault")["std"].to_dict()


def title(summary: Row) -> str:
    """Return the answer of a run in a sentence: special cases, else who is faster by how much."""
    rows = [
        r
        for r in (summary.get("tradeoff") or {}).get("matched", ())
        if r["estimator"] not in CONTROLS
    ]
    if not rows:
        return f"{summary['title']}: nothing was compared at equal noise"
    matched = faults_of(rows)
    names = list(matched["estimator"].unique())
    if matched["lag"].isna().all():
        return "No estimator survived: every run was lost"
    if few := too_few(rows):
        return f"{summary['title']}: {few}"
    if len(names) == 1:
        ratio = between(matched["over_bound"])
        return f"{names[0]} takes {ratio} times the shortest lag that theory allows"
    return _fastest(matched, summary)


def _fastest(matched: pd.DataFrame, summary: Row) -> str:
    """Return who is fastest, in how many faults or by how much."""
    first, count = leading(matched, order_of(summary))
    if not first:
        return f"{len(summary['seeds'])} seeds cannot tell the estimators apart"
    if times := _faster(matched, first):
        who = f"{listed(first)} track{'s' * (len(first) == 1)}"
        return f"{who} a fault {times} times faster than {REFERENCE}, at equal noise"
    who = f"{listed(first)} {'is' if len(first) == 1 else 'are'}"
    return f"{who} fastest in {count} of {matched['fault'].nunique()} faults, at equal noise"


def _faster(matched: pd.DataFrame, first: Sequence[str]) -> str:
    """Return how many times faster than the reference some estimators are; empty if unknown."""
    equal = matched[matched["how"] == "matched"]
    lags = equal.pivot(index="estimator", columns="fault", values="lag")
    if REFERENCE in first or REFERENCE not in lags.index:
        return ""
    ratios = (lags.loc[REFERENCE] / lags.reindex(first)).to_numpy().ravel()
    ratios = ratios[np.isfinite(ratios)]
    if not len(ratios) or ratios.min() < 1.05:
        return ""
    ends = [f"{r:.0f}" if r >= 3 else short(r) for r in (ratios.min(), ratios.max())]
    return " to ".join(dict.fromkeys(ends))


def points(summary: Row) -> list[str]:
    """Return what stands under the title, a sentence a fact; nothing if the title says it all."""
    rows = [
        r
        for r in (summary.get("tradeoff") or {}).get("matched", ())
        if r["estimator"] not in CONTROLS
    ]
    matched, order = faults_of(rows), order_of(summary)
    if matched.empty or matched["estimator"].nunique() == 1 or too_few(rows):
        return []
    first, count = leading(matched, order)
    if not first:
        return []
    faults, wins = matched["fault"].nunique(), matched[matched["leads"]].groupby("estimator").size()
    ties = [
        f" {name} ties in {wins[name]} of {faults}."
        for name in order
        if name in wins.index and name not in first
    ]
    same = f" (no significant difference, {len(summary['seeds'])} seeds)" if len(first) > 1 else ""
    where = f" in {count} of {faults} faults" if count < faults else ""
    near = matched.groupby("estimator")["over_bound"].agg(list)
    far = f"{first[0]} takes {between(near[first[0]])} times the shortest lag that theory allows"
    if REFERENCE in near.index and REFERENCE not in first:
        far += f"; {REFERENCE}, the paper’s method, {between(near[REFERENCE])} times"
    known = [f"{far}."] if np.isfinite(near[first[0]]).any() else []
    return [f"Fastest{where}: {listed(first)}{same}.{''.join(ties)}", *known]


def warning(rows: Iterable[Row], scenarios: Mapping[str, Row]) -> tuple[str, str] | None:
    """Return the one line not to be missed, and its scenario.

    That is where the largest share of the estimators is biased before the fault, or lost.

    Parameters
    ----------
    rows : iterable of mapping
        Pooled, at default settings.
    scenarios : mapping of str to mapping
        With their `definition`.
    """
    able = [r for r in rows if r["changed"] and r["estimator"] not in CONTROLS]
    worst: tuple[float, str, str] | None = None
    for name in dict.fromkeys(row["scenario"] for row in able):
        here = [row for row in able if row["scenario"] == name]
        bad = [r for r in here if abs(r["bias"] or 0.0) > BIASED or r["diverged"]]
        share = len(bad) / len(here)
        if bad and (worst is None or share > worst[0]):
            worst = share, _biased(here, bad, scenarios[name]["definition"]), name
    return worst and worst[1:]


def _biased(here: Sequence[Row], bad: Sequence[Row], definition: Definition) -> str:
    """Return who is biased, or lost, in a scenario."""
    names = list(dict.fromkeys(row["estimator"] for row in bad))
    good = list(dict.fromkeys(r["estimator"] for r in here if r["estimator"] not in names))
    few = 0 < len(good) < 3 and len(names) > 1
    who = f"every estimator but {listed(good)}" if few else listed(names)
    who = who if good else "every estimator"
    beside = unmodelled(definition)
    where = f"With {beside} that the model lacks" if beside else f"With {happens(definition)}"
    lost, runs = sum(row["diverged"] for row in bad), sum(row["seeds"] for row in bad)
    off = [abs(row["bias"]) for row in bad if abs(row["bias"] or 0.0) > BIASED]
    verb = "are" if len(names) > 1 and good and not few else "is"
    if off:
        more = f"; {lost} of {runs} runs are lost" if lost else ""
        return (
            f"{where}, {who} {verb} off by {between(off)} % even before the fault "
            f"(default settings){more}."
        )
    return f"{where}, {lost} of {runs} runs of {who} are lost (default settings)."


def failures_in_words(failures: Sequence[Row]) -> list[tuple[str, int]]:
    """Return a sentence for each kind of failure, and how many cases failed like that.

    Parameters
    ----------
    failures : sequence of mapping
        With `scenario`, `estimator`, `seed` and `error`.
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for row in failures:
        where = f"{row['scenario']}, seed {row['seed']}"
        text = row["error"].partition(": ")[2]
        if not text.startswith(row["estimator"]):  # else it names estimator and case itself
            text = f"{row['estimator']} failed on {where}: {row['error']}"
        alike = _SAMPLE.sub("", row["error"].replace(where, ""))[:60]
        kinds.setdefault((row["estimator"], alike), []).append(text)
    return [(texts[0], len(texts)) for texts in kinds.values()]


_SAMPLE = re.compile(r", sample \d+( \([^)]*\))?")


_FAULT = re.compile(r"fault\[(\d+)\]\.(\w+)")
_OF_FAULT = {
    "factor": "{} after the fault / before",
    "at": "time of the fault of {} [s]",
    "over": "time over which {} changes [s]",
    "time_constant": "time constant of the change of {} [s]",
    "on": "time with the fault of {} [s]",
    "off": "time without the fault of {} [s]",
    "until": "end of the fault of {} [s]",
    "parameter": "parameter that changes",
    "kind": "kind of fault",
}
_KEYS = {
    "duration": "length of the run [s]",
    "period": "sampling period [s]",
    "start": "first estimate / nominal",
    "burn_in": "burn-in [s]",
    "noise.speed": "noise of the speed, 1σ [rad/s]",
    "noise.angle": "noise of the angle, 1σ [rad]",
    "noise.torque": "noise of the torque, 1σ [N m]",
    "encoder.counts": "counts of the encoder in a turn",
    "delay.measurement": "delay of the measurement [samples]",
    "delay.torque": "delay of the torque [s]",
    "filter.speed": "time constant of the filter of the speed [s]",
    "controller.Kp": "position gain [1/s]",
    "controller.Kv": "speed gain [N m s/rad]",
    "controller.Ki": "integral gain [1/s]",
    "controller.tau": "time constant of the controller [s]",
    "controller.rate": "rate of the controller [Hz]",
    "excitation.low": "lower end of the excitation [Hz]",
    "excitation.high": "upper end of the excitation [Hz]",
    "excitation.period": "period of the excitation [s]",
    "excitation.rms": "size of the reference, rms [rad]",
    "excitation.reach": "reach of the moves [rad]",
    "excitation.move": "time of a move [s]",
    "excitation.dwell": "rest after a move [s]",
    "friction.coulomb": "Coulomb friction [N m]",
    "backlash.gear": "gap of the gear [rad]",
    "cogging.amplitude": "cogging, amplitude [N m]",
    "cogging.poles": "periods of cogging in a turn",
    "stiffening.gear": "cubic over linear stiffness of the gear [1/rad²]",
    "saturation.torque": "limit of the torque [N m]",
    "told.noise": "noise as told, 1σ [rad/s]",
    "told.torque_limit": "limit of the torque as told [N m]",
    "told.poles": "periods of cogging as told",
}
_OPTIONS = {
    "forgetting": "forgetting factor λ",
    "regularization": "regularisation μ",
    "drift": "size of the drift Δ",
}


def axis_words(key: str, study: Row) -> str:
    """Return what a swept key is called: words with the unit, else the key.

    Parameters
    ----------
    key : str
        Such as ``"fault[0].factor"`` or ``"rpem-forgetting.forgetting"``.
    study : mapping
        As in study.json: its estimators, and the definitions of its scenarios.

    Examples
    --------
    >>> axis_words("noise.speed", {})
    'noise of the speed, 1σ [rad/s]'
    >>> axis_words("ekf.forgetting", {"estimators": ["ekf"]})
    'forgetting factor λ of ekf'
    """
    if key in _KEYS:
        return _KEYS[key]
    if fault := _FAULT.fullmatch(key):
        return _of_fault(int(fault[1]), fault[2], study) or key
    table, _, name = key.rpartition(".")
    if table == "parameters" and name in (units := PARAMETER_UNITS | dict(LAW_UNITS)):
        return f"{name} [{units[name]}]"
    if table == "told":
        return f"{name} as told / true nominal"
    if table == ALL or any(table == text.partition("[")[0] for text in study.get("estimators", ())):
        whose = "" if table == ALL else f" of {table}"
        return f"{_OPTIONS.get(name, name.replace('_', ' '))}{whose}"
    return key


def _of_fault(place: int, name: str, study: Row) -> str | None:
    """Return the words of a key of a fault; of one whose parameter is swept too, without it."""
    if name not in _OF_FAULT:
        return None
    faults = [entry["definition"].get("fault", ()) for entry in study.get("scenarios", ())]
    named = {each[place].get("parameter") for each in faults if len(each) > place}
    fixed = len(named) == 1 and f"fault[{place}].parameter" not in study.get("axes", ())
    return _OF_FAULT[name].format(named.pop() if fixed else f"parameter {place + 1}")
