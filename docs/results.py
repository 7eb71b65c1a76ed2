"""Run the benchmarks for docs/results.md, and insert the result tables into the page.

The command is `python docs/results.py [--seeds 3000:3020] [--jobs 2]`. The script runs the
estimators once for each table, and stores the runs in results/docs. The script writes the pooled
scores of all tables to docs/data/results.csv. With 20 seeds, the script takes about half an hour on
two cores. To resume an interrupted run, repeat the command. With `--picture`, the script only draws
docs/images/fm_step.png, which is the figure in the README.
"""

import argparse
import re
import tempfile
from importlib.metadata import version
from pathlib import Path

import pandas as pd

import flexaxis as fx
from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.figures import around, curves, medians
from flexaxis.experiments.running.runner import Runner
from flexaxis.experiments.running.study import Study

HERE = Path(__file__).parent
PAGE, ROWS = HERE / "results.md", HERE / "data" / "results.csv"
UKF = "ukf"  # name of docs/examples/ukf.py in the tables
AXIS = ("fm_step", "fm_double", "ja_step", "kt_step", "two_faults",
        "coulomb_fm_step", "coulomb_fc_step", "lugre_fm_step", "cogging_fm_step",
        "backlash_fm_step", "told_kg_fm_step", "load_friction_fm_step")  # fmt: skip
RUNS = {
    "axis": (AXIS, ("glr", "imm", "ekf", f"{HERE / 'examples/ukf.py'}:Ukf", "cusum-reset",
                    "rpem-forgetting")),
    "encoders": (("encoder_fm_step", "coarse_encoder_fm_step", "encoder_coulomb_fm_step"),
                 ("glr", "imm", "ekf", "cusum-reset", "rpem-forgetting")),
    "drives": ("drives", ("glr", "imm", "ekf", "rpem-forgetting")),
}  # fmt: skip
"""Scenarios and estimators of each table in docs/results.md."""
KEPT = ["table", "scenario", "estimator", "parameter", "changed", "runs", "lag", "lag_bound",
        "lag_bound_learnt", "t10", "bias", "std", "cross_talk", "diverged"]  # fmt: skip


def pooled(name: str, seeds: str, jobs: int) -> pd.DataFrame:
    """Return the scores of one table, pooled over the seeds."""
    scenarios, estimators = RUNS[name]
    folder = HERE.parent / "results" / "docs" / name
    results = fx.benchmark(estimators, scenarios=scenarios, seeds=seeds, folder=folder, jobs=jobs)
    rows = results.scores("scenario", "estimator").assign(table=name)
    short = {text: UKF if text.endswith(":Ukf") else text for text in estimators}
    return rows.replace({"estimator": short})


def table(rows: pd.DataFrame) -> str:
    """Return a Markdown table with one row per fault and one column per estimator."""
    changed = rows[rows["changed"] & rows["lag"].notna()]
    cells = {}
    for row in changed.to_dict("records"):
        cells.setdefault((row["scenario"], row["parameter"]), {})[row["estimator"]] = cell(row)
    names = [name for name in dict.fromkeys(rows["estimator"])]
    lines = [["scenario, fault in", *(f"`{name}`" for name in names)], ["---"] * (len(names) + 1)]
    lines += [[f"`{scenario.removesuffix('-v1')}`, {parameter}", *(by.get(n, "–") for n in names)]
              for (scenario, parameter), by in cells.items()]  # fmt: skip
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def cell(row: dict) -> str:
    """Return a table cell with the lag, bias, noise, detections and number of diverged runs."""
    bounds = [row[name] for name in ("lag_bound", "lag_bound_learnt") if row[name] > 0]
    ratios = "/".join(dict.fromkeys(f"{row['lag'] / bound:.2g}" for bound in bounds))
    times = f" ({ratios} ×)" if bounds else ""
    parts = [f"{row['lag']:.2g} s{times}", f"{row['bias']:+.2g} ± {row['std']:.2g} %"]
    if isinstance(heard := row["detection"], dict):
        parts.append(f"found {1 - heard['missed']:.0%}, named {heard['isolated'] or 0:.0%}")
        parts.append(f"{2 * (heard['false_alarms_per_1000_s'] or 0):.2g} false")
    if row["diverged"]:
        parts.append(f"**{row['diverged']} of {row['runs']} lost**")
    return "; ".join(parts)


def write(rows: pd.DataFrame, seeds: str) -> None:
    """Insert the tables into docs/results.md, and write the pooled scores to docs/data/results.csv.

    Each table replaces the lines between two marker comments in docs/results.md.
    """
    text = PAGE.read_text(encoding="utf-8")
    command = f"python docs/results.py --seeds {seeds}"
    below = f"\n*Measured with `{command}` and flexaxis {version('flexaxis')}.*\n"
    for name, part in rows.groupby("table"):
        text = re.sub(rf"(<!-- table: {name} -->\n).*?(<!-- end -->)",
                      lambda m, part=part: m[1] + table(part) + below + m[2],
                      text, flags=re.DOTALL)  # fmt: skip
    PAGE.write_text(text, encoding="utf-8")
    detection = pd.json_normalize(
        [each if isinstance(each, dict) else {} for each in rows["detection"]]
    )
    detection = detection.drop(columns="false_alarms_interval").add_prefix("detection.")
    flat = pd.concat([rows[KEPT].reset_index(drop=True), detection], axis=1)
    flat.to_csv(ROWS, index=False, float_format="%.4g")


def draw_picture() -> None:
    """Draw the medians and 10–90 % ranges of two estimators' estimates around a fault."""
    scenario, window = find_scenario("fm_step-v1"), (5.0, 20.0)
    seeds = tuple(range(1000, 1030))
    study = Study("fm_step", (scenario,), ("rpem-forgetting", RECOMMENDED), seeds)
    with tempfile.TemporaryDirectory() as place, Runner(Path(place), jobs=2) as runner:
        results = runner.run(study, traces=True)
        traces = {who: results.traces(scenario.hash, who) for who in study.estimators}
    panels = {
        f"{name} / nominal": medians(traces, scenario, name, window, banded=study.estimators)
        for name in scenario.identify
    }
    drawn = curves(panels, x="time [s]", limits={"time [s]": window}, **around(scenario))
    drawn.savefig(HERE / "images" / "fm_step.png", dpi=180)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument(
        "--seeds", default="3000:3020", help="range of seeds, FROM:TO (default: 3000:3020)"
    )
    options.add_argument(
        "--jobs", type=int, default=2, help="number of worker processes (default: 2)"
    )
    options.add_argument("--picture", action="store_true", help="draw only the README figure")
    chosen = options.parse_args()
    if chosen.picture:
        draw_picture()
    else:
        tables = [pooled(name, chosen.seeds, chosen.jobs) for name in RUNS]
        write(pd.concat(tables), chosen.seeds)
