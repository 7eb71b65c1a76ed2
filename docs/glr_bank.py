"""Draw what the bank of `glr` believes around a fault: `python docs/glr_bank.py`, seconds.

On the left the motor's friction rises by half, on the right the load grows by a tenth: the
estimate, the probability that each parameter has jumped, and when, in the sample before something
is found. After that the bank begins anew.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.simulate import simulate

PICTURE = Path(__file__).parent / "images" / "glr_bank.png"
SEED = 1000
FAULTS = {"fm_step-v1": ("f_m", "f_m [N m s/rad]"), "ja_step-v1": ("1/J_a", "1/J_a [1/(kg m²)]")}
"""Scenarios, what jumps in each, and how it is written."""
BEFORE, AFTER = 0.05, 0.4  # s, around the fault
COLOURS = {"f_m": "C0", "1/J_a": "C1", "k_T": "C2", "J_m": "C3", "k_g": "C4", "f_c": "C6"}
REST = "0.6"


def draw(scenario_name: str, upper: Axes, middle: Axes, lower: Axes) -> None:
    """Run one fault sample by sample, and draw three panels."""
    scenario, (jumped, label) = find_scenario(scenario_name), FAULTS[scenario_name]
    record, estimator = simulate(scenario, [SEED])[0], build(parse("glr"), scenario)
    period, event = scenario.period, scenario.events()[0]
    first, last = (round(event.index + s / period) for s in (-BEFORE, AFTER))
    run_estimator(estimator, record.torque[:first], record.speed[:first])
    i = list(estimator.names).index(jumped)
    estimates, beliefs, whole, known = [], [], {}, len(estimator.findings)
    for k in range(first, last):
        if len(estimator.findings) == known:
            whole, seen = estimator.hypotheses, (k - 1 - event.index) * period
        theta = run_estimator(estimator, record.torque[k : k + 1], record.speed[k : k + 1])
        estimates.append((theta[0, i], np.sqrt(estimator.covariance[i, i])))
        beliefs.append(estimator.beliefs)
    time = (np.arange(first, last) - event.index) * period
    mean, deviation = np.transpose(estimates)
    exponent = -1 if jumped.startswith("1/") else 1
    truth = [event.before**exponent, event.after**exponent]
    upper.fill_between(time, mean - 2 * deviation, mean + 2 * deviation, color="C0", alpha=0.2)
    upper.plot(time, mean, "C0", label="estimate ± 2 standard deviations")
    upper.step([-BEFORE, 0.0, AFTER], [truth[0], *truth], "k--", where="pre", label="truth")
    upper.set(title=scenario_name.removesuffix("-v1"), ylabel=label)
    for name in beliefs[0]:
        colour = COLOURS.get(name, REST)
        middle.plot(time, [100 * b[name] for b in beliefs], color=colour,
                    label=name if name in COLOURS else None)  # fmt: skip
    middle.set(ylabel="has jumped [%]", xlabel="time since the fault [s]", ylim=(-3, 103))
    for finding in (f for f in estimator.findings if first <= f.alarm < last):
        said, at = f"{finding.parameters[0]} × {finding.ratio[0]:.3g}", finding.alarm - event.index
        upper.axvline(at * period, color="0.4", ls=":", label=f"found: {said}")
        middle.axvline(at * period, color="0.4", ls=":")
    for axes in (upper, middle):
        axes.set_xlim(-BEFORE, AFTER)
    for name, rows in whole.items():
        ago, weight = rows[:, 0] * period, rows[:, 1]
        lower.plot(seen - ago, np.maximum(weight, 1e-9), "o", ms=4, color=COLOURS.get(name, REST))
    lower.axvline(0.0, color="k", ls="--")
    lower.set(yscale="log", ylim=(1e-6, 1.5), ylabel="probability", xlim=(-BEFORE, AFTER),
              xlabel=f"onset of the hypothesis [s], seen {seen:.3g} s after the fault")  # fmt: skip
    upper.legend(loc="lower right")


def main() -> None:
    """Draw both faults."""
    figure = Figure(figsize=(11, 9), layout="constrained")
    panels = figure.subplots(3, 2)
    for name, column in zip(FAULTS, panels.T, strict=True):
        draw(name, *column)
    panels[1, 1].legend(loc="center right", title="grey: all others")
    figure.savefig(PICTURE, dpi=100)


if __name__ == "__main__":
    main()
