"""Measure glr beside the bound where friction has a shape that it has to find, for docs/glr.md.

`python docs/glr_shapes.py` writes the table; the bound is for who knows neither the parameters that
are estimated nor the coefficient of the shape, and all else.
"""

from pathlib import Path

import numpy as np
from making import VERSION, table, write

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.estimator_text import build, parse
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.case import track_of
from flexaxis.experiments.scoring.bounds import jump_bound, lag_bound
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.score_table import rows as scores
from flexaxis.experiments.scoring.true_model import found_of, tracked
from flexaxis.sim.simulate import simulate

PAGE = Path(__file__).parent / "glr.md"
CASES = ("directional_fm_step-v1", "load_friction_fm_step-v1")
SEEDS = range(1000, 1020)


def measured(name: str) -> list[str]:
    """Return the line of a scenario."""
    scenario, lags, bounds = find_scenario(name), [], []
    event = scenario.events()[0]
    names = (*tracked(scenario, scenario.identify), *found_of(scenario))
    i = scenario.identify.index(event.parameter)
    for record in simulate(scenario, SEEDS):
        estimator = build(parse("glr"), scenario)
        theta = run_estimator(estimator, record.torque, record.speed)
        track = track_of(scenario, record, tuple(estimator.names), theta, None, None, None)
        (mine,) = [row for row in scores(track) if row["parameter"] == event.parameter]
        window = next(w for w in track.windows if w.parameter == event.parameter)
        sd = jump_bound(scenario, names, window.start, window.stop, record.torque).unknown[:, i]
        lags.append(mine["lag"])
        bounds.append(lag_bound(sd, window.D, period=scenario.period))
    ratio = np.log(lags) - np.log(bounds)
    low, high = np.exp(mean_interval(ratio))
    each = (np.exp(np.mean(np.log(x))) for x in (lags, bounds))
    return [name.removesuffix("-v1"), ", ".join(found_of(scenario)), *(f"{x:.3g}" for x in each),
            f"{np.exp(ratio.mean()):.3g} ({low:.3g} … {high:.3g})"]  # fmt: skip


def shapes() -> str:
    """Return the table."""
    heads = ["case", "unknown besides", "lag of `glr` [s]", "bound [s]", "× bound"]
    below = f"\n`python docs/glr_shapes.py`, {VERSION}, seeds {SEEDS[0]} to {SEEDS[-1]}.\n"
    return table(heads, [measured(name) for name in CASES]) + below


if __name__ == "__main__":
    write(PAGE, {"shapes": shapes})
