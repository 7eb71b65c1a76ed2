"""How many samples a second go through the door to a program, as ratios within one run.

    python tests/experiments/doors.py [--rounds 5] [--samples 4000]

The same method everywhere, f_m by prediction errors, in C, Python and GNU Octave, as far as they
are installed; the program is started before the time is taken. "empty" is a program in C that
answers zeros: the door itself.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
EMPTY = """#include "flexaxis.h"
static void step(void *state, double u, double y, double *theta) {
    (void)state, (void)u, (void)y;
    theta[0] = 0;
}
int main(void) {
    flexaxis_axis axis = flexaxis_open();
    const char *names[] = {"f_m"};
    flexaxis_serve(names, 1, axis.output, step, NULL);
    return 0;
}
"""


def programs(place: Path) -> dict[str, str]:
    """Return the command of each program, by its language."""
    from flexaxis.experiments.cli import main

    found = {"Python": f"{shlex.quote(sys.executable)} {EXAMPLES / 'pipe_friction.py'}"}
    with contextlib.redirect_stdout(io.StringIO()):
        if shutil.which("cc"):
            main(["new", str(place / "mine.c")])
            (place / "empty.c").write_text(EMPTY)
            for name in ("mine", "empty"):
                words = ["cc", "-O2", "-o", str(place / name), str(place / f"{name}.c"), "-lm"]
                subprocess.run(words, check=True)
            found |= {"C": str(place / "mine"), "empty": str(place / "empty")}
        if shutil.which("octave-cli"):
            main(["new", str(place / "mine.m")])
            found["Octave"] = f"octave-cli -q {place / 'mine.m'}"
    return found


def main() -> int:
    """Measure in turn, and print the table."""
    from flexaxis.estimators.protocol import run_estimator
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.running.estimators import build, parse
    from flexaxis.sim.simulate import simulate

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--samples", type=int, default=4000)
    args = parser.parse_args()
    scenario = find_scenario("fm_step-v1")
    record = simulate(scenario, [0])[0]
    u, y = (np.resize(x, args.samples) for x in (record.torque, record.speed))
    with tempfile.TemporaryDirectory() as place:
        commands = programs(Path(place))
        rates: dict[str, list[float]] = {key: [] for key in commands}
        for _ in range(args.rounds):
            for key, command in commands.items():
                estimator = build(parse(f"pipe:{command}"), scenario)
                run_estimator(estimator, u[:200], y[:200])
                start = time.perf_counter()
                run_estimator(estimator, u, y)
                rates[key].append(args.samples / (time.perf_counter() - start))
    unit = rates["Python"]
    print(f"{'program':8} {'samples/s':>10} {'ratio to Python':>16}  range")
    for who, found in sorted(rates.items()):
        ratios = [own / other for own, other in zip(found, unit, strict=True)]
        middle, low, high = statistics.median(ratios), min(ratios), max(ratios)
        print(f"{who:8} {statistics.median(found):10.0f} {middle:16.1f}  {low:.1f} … {high:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
