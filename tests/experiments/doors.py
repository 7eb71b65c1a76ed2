"""How many samples a second go through each door to a program, as ratios within one run.

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
# The loop of the template in C over the binary door, in Python: expm of scipy as in the example.
BINARY = """
import struct, sys
class Lines:
    def __iter__(self):
        while len(count := take(8)) == 8:
            n, = struct.unpack("<Q", count)
            samples = struct.unpack(f"<{2 * n}d", take(16 * n))
            for u, y in zip(samples[::2], samples[1::2]):
                yield {"u": u, "y": None if y != y else y}
            sys.stdout.flush()
take, give = sys.stdin.buffer.read, sys.stdout.buffer.write
take(16)
period, output, values, names = struct.unpack("<dIII", take(20))
nominal = {}
for _ in range(values):
    name = take(32).rstrip(b"\\0").decode()
    nominal[name], = struct.unpack("<d", take(8))
take(32 * names)
header = {"period": period, "nominal": nominal}
give(b"FLEXAXIS" + struct.pack("<IIII", 1, 0x01020304, 1, 0) + b"f_m".ljust(32, b"\\0"))
sys.stdout.flush()
"""


def python_program(place: Path) -> Path:
    """Write the example in Python with the other door, and return its path."""
    text = (EXAMPLES / "pipe_friction.py").read_text(encoding="utf-8")
    head, _, rest = text.partition("# The first line says")
    rest = rest.partition("\n\n")[2]
    rest = rest.replace("for line in sys.stdin:\n    sample = json.loads(line)\n",
                        "for sample in Lines():\n")  # fmt: skip
    rest = rest.replace('answer({"theta": [theta]})', 'give(struct.pack("<d", theta))')
    path = place / "binary.py"
    path.write_text(head + BINARY + "T, n = period, nominal\n" + rest, encoding="utf-8")
    return path


def programs(place: Path) -> dict[tuple[str, str], str]:
    """Return the command of each program, by its language and its door."""
    from flexaxis.experiments.cli import main

    python = shlex.quote(sys.executable)
    found = {
        ("Python", "pipe"): f"{python} {EXAMPLES / 'pipe_friction.py'}",
        ("Python", "pipe-binary"): f"{python} {python_program(place)}",
    }
    with contextlib.redirect_stdout(io.StringIO()):
        if shutil.which("cc"):
            main(["new", str(place / "mine.c")])
            (place / "empty.c").write_text(EMPTY)
            for name in ("mine", "empty"):
                words = ["cc", "-O2", "-o", str(place / name), str(place / f"{name}.c"), "-lm"]
                subprocess.run(words, check=True)
            found |= {("C", "pipe-binary"): str(place / "mine")}
            found |= {("empty", "pipe-binary"): str(place / "empty")}
        if shutil.which("octave-cli"):
            main(["new", str(place / "mine.m")])
            found |= {
                ("Octave", "pipe"): f"octave-cli -q {EXAMPLES / 'pipe_friction.m'}",
                ("Octave", "pipe-binary"): f"octave-cli -q {place / 'mine.m'}",
            }
    binary = {key: command for key, command in found.items() if key[1] == "pipe-binary"}
    return found | {(who, "pipe-binary-step"): command for (who, _), command in binary.items()}


def main() -> int:
    """Measure in turn, and print the table."""
    from flexaxis.estimators.protocol import run_estimator
    from flexaxis.experiments.building.specs import build, parse
    from flexaxis.experiments.catalogue.find import find_scenario
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
        rates: dict[tuple[str, str], list[float]] = {key: [] for key in commands}
        for _ in range(args.rounds):
            for key, command in commands.items():
                estimator = build(parse(f"{key[1]}:{command}"), scenario)
                run_estimator(estimator, u[:200], y[:200])
                start = time.perf_counter()
                run_estimator(estimator, u, y)
                rates[key].append(args.samples / (time.perf_counter() - start))
    unit = rates["Python", "pipe"]
    print(f"{'program':8} {'door':18} {'samples/s':>10} {'ratio to Python, pipe':>22}  range")
    for (who, door), found in sorted(rates.items()):
        ratios = [own / other for own, other in zip(found, unit, strict=True)]
        middle, low, high = statistics.median(ratios), min(ratios), max(ratios)
        print(
            f"{who:8} {door:18} {statistics.median(found):10.0f} {middle:22.1f}  "
            f"{low:.1f} … {high:.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
