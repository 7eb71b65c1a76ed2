"""The table of docs/logs.md on `flexaxis trend`: what wear is found when, and how often none.

    python tests/experiments/trend_tables.py wg_fc_step-v1 FOLDER --seeds 3000:3020 --wear 0,5,12,30

simulates sets of 60 daily logs with 25 K of temperature, estimates from each log once (rows of
FOLDER are kept, so that it goes on where it was stopped), and judges each set day by day. The axis
is known exactly, or with `--axis sheet` as data sheets tell it, up to 5 % off, or with `--axis
identified` as `flexaxis identify` finds it in the first log of each set, begun from that.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.as_log import LogStyle
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.days import (
    Days,
    calendar,
    known_axis,
    told_axis,
    without_faults,
    write_day,
)
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.importing import read_any
from flexaxis.experiments.logs.trend.covariates import clock, covariates_of
from flexaxis.experiments.logs.trend.estimates import Source, estimate_all, plan_for
from flexaxis.experiments.logs.trend.wear import CHANGED, OPEN, verdict, verdicts

STYLE = LogStyle(counts=65536)
WARM = {"f_c": -0.01, "f_m": -0.01}


def logs_of(folder, scenario, wear, seed):
    """Write the logs of a set that are not there; until wear begins they are those without."""
    days = Days(wear={"f_c": wear / 100} if wear else {}, warm=WARM)
    here = folder / f"{seed}-{wear:g}"
    here.mkdir(parents=True, exist_ok=True)
    paths = []
    for day in calendar(scenario, days, seed):
        path = here / f"{day.date[:10]}.csv"
        before = folder / f"{seed}-0" / path.name
        if not path.exists():
            if day.number <= days.from_day and before.exists():
                shutil.copy(before, path)
            else:
                write_day(here, scenario, day, seed=seed, style=STYLE)
        paths.append(path)
    return paths


def axis_of(folder, scenario, kind, seed):
    """Return what is known of the axis before the trend of a set; what was identified is kept."""
    if kind == "exact":
        return known_axis(scenario)
    told = told_axis(scenario, seed)
    if kind == "sheet":
        return told
    path = folder / f"{seed}-axis.toml"
    if not path.exists():
        first = min((folder / f"{seed}-0").glob("*.csv"))
        found = identify(read_any(first, {}), told)
        print(seed, "identified:", *found.warnings, flush=True)
        found.axis.save(path)
    return find_axis(str(path))


def judged(rows, covariates, days, false_alarms=0.01):
    """Return by parameter what is said after a number of days."""
    rows = [row for row in rows[:days] if not row["problem"]]
    when = clock(rows)
    given = covariates_of(rows, covariates)
    return when, verdicts(rows, when.time, given, false_alarms=false_alarms)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", default="0:2")
    parser.add_argument("--wear", default="0,12")
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--axis", choices=("exact", "sheet", "identified"), default="exact")
    args = parser.parse_args()
    scenario = without_faults(find_scenario(args.scenario), args.duration)
    first, last = map(int, args.seeds.split(":"))
    for seed in range(first, last):
        logs_of(args.folder, scenario, 0, seed)
        axis, plan = axis_of(args.folder, scenario, args.axis, seed), None
        for wear in map(float, args.wear.split(",")):
            logs = logs_of(args.folder, scenario, wear, seed)
            plan = plan or plan_for(logs, axis, Source({}, {}))
            rows = estimate_all(plan, logs, args.folder)
            bad = [row["problem"] for row in rows if row["problem"]]
            for covariates in (["temp"], []):
                when, found = judged(rows, covariates, 60)
                loud = [
                    f"{v.name} {v.kind} "
                    + ", ".join(
                        f"{c.shape} {float(v.percent(c.size)):+.1f}±{v.percent_deviation(c):.1f} % "
                        f"day {when.time[c.place]:.0f} [{when.time[c.earliest]:.0f}, "
                        f"{when.time[c.latest]:.0f}]"
                        for c in v.found.changes
                    )
                    for v in found
                    if v.kind in (CHANGED, OPEN)
                ]
                said = "; ".join(loud) or "nothing"
                print(
                    seed, f"{wear:+g} %", covariates or "no covariate", bad or "", said, flush=True
                )
            early = next((d for d in range(12, 61) if alarm(rows, d)), None)
            print(seed, f"{wear:+g} %: looked at each day, f_c is said on day", early, flush=True)


def alarm(rows, days):
    """Whether a change of f_c would be said after some days, of as many parameters as there are."""
    rows = [row for row in rows[:days] if not row["problem"]]
    temperature = covariates_of(rows, ["temp"])["temp"][:, None]
    each = [row["estimates"]["f_c"] for row in rows]
    value, sd = (np.array([one[key] for one in each]) for key in ("value", "sd"))
    found = verdict(
        "f_c", clock(rows).time, value, sd, temperature,
        false_alarms=0.01 / len(rows[0]["estimates"]),
    )  # fmt: skip
    return found.kind == CHANGED


if __name__ == "__main__":
    main()
