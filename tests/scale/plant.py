"""
What a record takes over what the engine takes of it, scenario by scenario.

``python tests/scale/plant.py`` for the whole catalogue, or with names of scenarios; ``--runs 16``
says how many are simulated side by side, as `flexaxis run` does with as many seeds. Processor time
of this thread, so that others on the machine do not count; the engine is what goes on inside
`mujoco.batch.Batch.step`, with what it calls of our compiled laws.
"""

import argparse
import time

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.catalogue.names import scenario_names
from flexaxis.sim.plant import plant
from flexaxis.sim.simulate import simulate


class Timed(plant.Batch):
    """A batch that adds up what its steps take [s]."""

    seconds = 0.0

    def step(self, *args, **how):
        start = time.thread_time()
        try:
            return super().step(*args, **how)
        finally:
            Timed.seconds += time.thread_time() - start


def ratio(name: str, runs: int) -> tuple[float, float]:
    """Return what a record takes [ms of the processor], and that over the engine's part."""
    scenario = find_scenario(name)
    Timed.seconds, start = 0.0, time.thread_time()
    simulate(scenario, range(runs))
    whole = time.thread_time() - start
    return 1e3 * whole / runs, whole / Timed.seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*")
    parser.add_argument("--runs", type=int, default=16)
    args = parser.parse_args()
    plant.Batch = Timed
    for name in ("fm_step-v1", "directional_fm_step-v1"):
        ratio(name, 1)  # imports, and what is compiled
    print(f"{'scenario':45}{'ms a record':>12}{'over engine':>12}")
    found = {}
    for name in args.scenarios or scenario_names():
        milliseconds, found[name] = ratio(name, args.runs)
        print(f"{name:45}{milliseconds:12.1f}{found[name]:12.3f}", flush=True)
    worst = max(found, key=found.__getitem__)
    print(f"{len(found)} scenarios, {args.runs} runs each: at most {found[worst]:.3f} ({worst})")


if __name__ == "__main__":
    main()
