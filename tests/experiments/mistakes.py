"""Forty mistakes at the command line: what is typed, what is answered, and how long that takes.

    python tests/experiments/mistakes.py [--rounds 3]

Each is a command of its own, with Python's start; beside it `import numpy` is timed, for what can
be trusted on a busy machine is the ratio. Mistakes in code of one's own are found when it runs.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

COMMAND = str(Path(sys.executable).with_name("flexaxis"))  # unlike -m, not in its own folder
FILES = {
    "short.toml": "preset = 'n1'\nname = 'short'\nduration = 8.0\nburn_in = 1.0\n"
    "identify = ['k_T', '1/J_a', 'f_m']\nstart = 1.0\noutput = 'speed'\nnoise.speed = 0.1\n"
    "[excitation]\nkind = 'multisine'\n[[fault]]\nkind = 'step'\nparameter = 'f_m'\nat = 6.0\n"
    "factor = 1.5\n",
    "broken.toml": "duration = = 8\n",
    "keys.toml": "preset = 'n1'\nname = 'k'\nduraton = 8.0\n[excitation]\nkind = 'multisin'\n",
    "study.toml": "scenario = 'fm_step-v1'\nestimators = ['frozen']\nseeds = 2\n[sweep]\n"
    "'fault[0].facter' = [1.0, 2.0]\n",
    "code.toml": "scenario = 'fm_step-v1'\nestimators = ['own.py:Mine']\nseeds = 2\n",
    "log.csv": "time,torque,angle\n0,1,2\n1,2\n",
    "rec.nc": "this is no NetCDF file",
    "own.py": """
class Mine:
    names, output = ("f_m",), "speed"
    def __init__(self, nominal, period): self.f_m, self.k = nominal["f_m"], 0
    def step(self, u, y): return [self.f_m]
class Typo(Mine):
    def __init__(self, nominal, period): self.f_m = nominal["fm"]
class Named(Mine):
    names = ("fm",)
class Raises(Mine):
    def step(self, u, y): return [self.f_m / 0]
class Exits(Mine):
    def step(self, u, y): raise SystemExit(3)
class Prints(Mine):
    def step(self, u, y):
        print("k =", self.k)
        return [self.f_m]
class NotFinite(Mine):
    def step(self, u, y): return [float("nan")]
class Shape(Mine):
    def step(self, u, y): return [self.f_m, 1.0]
class Forever(Mine):
    def step(self, u, y):
        while True: pass
class Output(Mine):
    output = "position"
""",
    "syntax.py": "class Mine\n    pass\n",
    "imports.py": "import nonexistent_library\n",
    "string.py": "raise RuntimeError('this is not the string of Python')\n",
}


@dataclass(frozen=True)
class Mistake:
    """A line with a mistake.

    Attributes
    ----------
    line : str
        Without `flexaxis`.
    status : int
        That is right for it.
    hint : str
        What the answer has to say.
    running : bool
        Whether it can be found only when something is run.
    """

    line: str
    status: int
    hint: str
    running: bool = False


RUN = "run short.toml --seeds 1 --jobs 1 -o out --estimator"
MISTAKES = (
    # what users did
    Mistake("rnu smoke", 2, "Did you mean 'run'?"),
    Mistake("run fm_stp-v1", 2, "Did you mean 'fm_step-v1'?"),
    Mistake("run smoke --estimator cusum-rset", 2, "Did you mean 'cusum-reset'?"),
    Mistake("run smoke --estimtor glr", 2, "Did you mean '--estimator'?"),
    Mistake("run smoke --estimator ekf[nois=1]", 2, "Did you mean 'noise'?"),
    Mistake("run smoke --seeds abc", 2, "--seeds 'abc'"),
    Mistake("compare --base frozn --candidate ekf", 2, "Did you mean 'frozen'?"),
    Mistake("tune rpem-forgeting", 2, "Did you mean 'rpem-forgetting'?"),
    Mistake("tune frozen", 2, "no knob to turn", True),
    Mistake("list scenario", 2, "Did you mean 'scenarios'?"),
    Mistake("check own.py:Typo", 70, "Did you mean 'f_m'?", True),
    Mistake("check own.py:Mien", 2, "Did you mean 'Mine'?", True),
    Mistake(f"{RUN} own.py:Named", 2, "'fm'", True),
    Mistake(f"{RUN} own.py:Raises", 70, "own.py:11", True),
    Mistake(f"{RUN} own.py:Exits", 70, "own.py:13", True),
    Mistake(f"{RUN} own.py:Prints", 0, "k = ", True),
    Mistake(f"{RUN} own.py:NotFinite", 1, "not finite", True),
    Mistake(f"{RUN} own.py:Forever --time-limit 1", 70, "no end within 1 s", True),
    Mistake("estimate rec.nc", 2, "rec.nc", True),
    Mistake("view own.nc", 2, "no such file"),
    # twenty more
    Mistake("", 2, "COMMAND"),
    Mistake("run", 2, "required"),
    Mistake("run smoke --jobs 0", 2, "--jobs 0"),
    Mistake("run smoke --jobs two", 2, "'two'"),
    Mistake("run broken.toml", 2, "broken.toml"),
    Mistake("run keys.toml", 2, "Did you mean 'duration'?"),
    Mistake("run smoke --shard 3/2", 2, "--shard '3/2'"),
    Mistake("run smoke --time-limit -1", 2, "time limit"),
    Mistake("run smoke --dask localhost:1 --jobs 2", 2, "not allowed with"),
    Mistake("compare ekf glr", 2, "ekf"),
    Mistake("study study.toml --dry-run", 2, "Did you mean", True),
    Mistake("study code.toml", 2, "--run-code"),
    Mistake("report nowhere", 2, "nowhere"),
    Mistake("show ekff", 2, "Did you mean 'ekf'?"),
    Mistake("check syntax.py:Mine", 2, "syntax.py", True),
    Mistake("check imports.py:Mine", 2, "nonexistent_library", True),
    Mistake(f"{RUN} own.py:Shape", 1, "own.py:Shape", True),
    Mistake(f"{RUN} own.py:Output", 2, "position", True),
    Mistake("simulate fm_step-v1 -o no/where/rec.nc", 2, "no/where", True),
    Mistake("check 'pipe:./nobody'", 2, "cannot be started", True),
)


@dataclass(frozen=True)
class Answered:
    """What was answered to a mistake: status, stderr, seconds, and those of `import numpy`."""

    mistake: Mistake
    status: int
    said: str
    seconds: float
    unit: float

    @property
    def wrong(self) -> list[str]:
        """What is not as it should be, the time apart."""
        found = []
        if self.status != self.mistake.status:
            found.append(f"status {self.mistake.status} is right")
        if self.mistake.hint not in self.said.replace("\n", " "):
            found.append(f"nothing of {self.mistake.hint!r}")
        return found + ["a traceback"] * ("Traceback (most" in self.said)


def answers(place: Path, mistakes: tuple[Mistake, ...] = MISTAKES) -> list[Answered]:
    """Type each mistake in a folder that has what they name."""
    for name, text in FILES.items():
        (place / name).write_text(text, encoding="utf-8")
    env = os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    found = []
    for mistake in mistakes:
        unit = timed([sys.executable, "-I", "-c", "import numpy"], place, env)[0]
        seconds, done = timed([COMMAND, *shlex.split(mistake.line)], place, env)
        found.append(Answered(mistake, done.returncode, done.stderr, seconds, unit))
    return found


def timed(
    words: list[str], place: Path, env: dict[str, str]
) -> tuple[float, subprocess.CompletedProcess[str]]:
    """Return how long a command takes [s], and what became of it."""
    start = time.perf_counter()
    done = subprocess.run(words, cwd=place, env=env, capture_output=True, text=True, check=False)
    return time.perf_counter() - start, done


def main() -> int:
    """Print command, answer, status, seconds and ratio of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="lines with this text")
    args = parser.parse_args()
    chosen = tuple(m for m in MISTAKES if args.only in m.line)
    with tempfile.TemporaryDirectory() as place:
        found = answers(Path(place), chosen)
    for each in found:
        when = "running" if each.mistake.running else "typed"
        print(f"$ flexaxis {each.mistake.line}")
        lines = [line for line in each.said.splitlines() if line.strip()]
        print("\n".join(f"  {line[:300]}" for line in lines[-3:]))
        ratio = each.seconds / each.unit
        print(f"  [status {each.status}, {each.seconds:.2f} s, {ratio:.1f} × import numpy; {when}]")
        print("".join(f"  WRONG: {text}\n" for text in each.wrong), end="")
    slowest = max((a.seconds for a in found if not a.mistake.running), default=0.0)
    print(f"slowest that is found before anything runs: {slowest:.2f} s")
    return int(any(each.wrong for each in found))


if __name__ == "__main__":
    sys.exit(main())
