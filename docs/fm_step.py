"""Draw the picture of README.md anew: `python docs/fm_step.py`, a minute or two.

The paper's method and the recommended estimator as they are set, on a motor whose friction rises
by half: median and 10–90 % of thirty runs.
"""

import tempfile
from pathlib import Path

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.figures import around, curves, medians
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.study import Study

PICTURE = Path(__file__).parent / "images" / "fm_step.png"
SEEDS = tuple(range(1000, 1030))


def main() -> None:
    """Run, and draw."""
    scenario = find_scenario("fm_step-v1")
    study = Study("fm_step", (scenario,), ("rpem-forgetting", RECOMMENDED), SEEDS)
    with tempfile.TemporaryDirectory() as place, Runner(Path(place), jobs=2) as runner:
        results = runner.run(study, traces=True)
        traces = {who: results.traces(scenario.hash, who) for who in study.estimators}
    window = (5.0, 20.0)
    panels = {
        f"{name} / nominal": medians(traces, scenario, name, window, banded=study.estimators)
        for name in scenario.identify
    }
    drawn = curves(panels, x="time [s]", limits={"time [s]": window}, **around(scenario))
    drawn.savefig(PICTURE, dpi=180)


if __name__ == "__main__":
    main()
