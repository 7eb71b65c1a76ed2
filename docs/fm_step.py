"""Draw the picture of README.md anew: `python docs/fm_step.py`, a minute or two.

The paper's method and the recommended estimator as they are set, on a motor whose friction rises
by half: median and 10–90 % of thirty runs.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.figures import figure
from flexaxis.experiments.reporting.old_results import load
from flexaxis.experiments.reporting.run.over_time import trajectories
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark

PICTURE = Path(__file__).parent / "images" / "fm_step.png"
SEEDS = tuple(range(1000, 1030))


def main() -> None:
    """Run, and draw."""
    scenario = find_scenario("fm_step-v1")
    study = Study("fm_step", (scenario,), ("rpem-forgetting", RECOMMENDED), SEEDS)
    with tempfile.TemporaryDirectory() as place:
        with Runner(Path(place), jobs=2) as runner:
            work = Benchmark(study, title="fm_step", command="python docs/fm_step.py")
            benchmark(work, runner)
        curves = load(Path(place)).curves
    chart = trajectories(curves, scenario, name="fm_step")
    drawn = figure(replace(chart, windows=[("", 5.0, 20.0)]))
    drawn.set_size_inches(8.0, 5.8)
    drawn.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
