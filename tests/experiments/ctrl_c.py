"""Press Ctrl-C in commands that work in a terminal, once and twice, and show what they say.

    python tests/experiments/ctrl_c.py [COMMAND …] [--after 6]

Each command runs in a pseudo-terminal of its own, where Ctrl-C goes to all its processes, as for a
person; the processes of the session are counted when it has ended.
"""

from __future__ import annotations

import argparse
import os
import pty
import re
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

CTRL_C = b"\x03"
TWICE = 0.3  # s between one Ctrl-C and the next
PATIENCE = 300.0  # s for a command to end: more is a hang
ENDING = 30.0  # s for what a command has started to end after it
COMPILING = 600.0  # s for one to begin, on a slow machine with everything to compile
# What each says where it begins: a bar, for which a recording has no room beside a long path.
BEGUN = {"demo": "live axis is at", "record": "recording"}
BAR = "━"


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes
    ----------
    status : int or None
        Exit status; None where it did not end, and was killed.
    seconds : float
        From the last Ctrl-C to its end.
    said : str
        What stood in the terminal.
    orphans : int
        Processes of its session that had not ended half a minute later.
    """

    status: int | None
    seconds: float
    said: str
    orphans: int


def commands(place: Path) -> dict[str, list[str]]:
    """Return the commands that work for long, and write to a place."""
    (place / "study.toml").write_text(
        "name = 'long'\nscenario = 'fm_step-v1'\nestimators = ['literal-rpem', 'frozen']\n"
        "seeds = 400\n"
    )
    lines = {
        "run": "run smoke --estimator literal-rpem --seeds 200 --jobs 2",
        "study": f"study {place}/study.toml --jobs 2",
        "compare": "compare --base frozen --candidate literal-rpem --seeds 64 --jobs 2",
        "tune": "tune ekf --seeds 0:64 --jobs 2",
        "tradeoff": "tradeoff fm_step-v1 --estimator literal-rpem --seeds 32 --jobs 2",
        "paper": "paper --jobs 2 --no-cache",
    }
    words = {name: [*shlex.split(line), "-o", str(place / name)] for name, line in lines.items()}
    demo = ["demo", "--no-browser", "--port", "8197"]
    return words | {
        "record": ["demo", "--record", str(place / "lesson.gif")],
        "demo": demo,
    }


def press(words: Sequence[str], times: int, after: float, begun: str = "") -> Ended:
    """Run a command in a terminal, press Ctrl-C so often, and return how it ended.

    Parameters
    ----------
    words : sequence of str
        Of the command.
    times : int
    after : float
        How long it works before [s], from when `begun` is said.
    begun : str
        What it says first; by default from its start on.
    """
    ends, end = os.pipe()
    shell, terminal = pty.fork()
    if not shell:
        _stay_as_a_shell_does(words, end)
    os.close(end)
    said = [_heard(terminal, COMPILING, begun, ends=ends)] if begun else []
    said.append(_heard(terminal, after))
    for time_ in range(times):
        said.append(_heard(terminal, TWICE) if time_ else "")
        pressed = time.monotonic()
        os.write(terminal, CTRL_C)
    said.append(_heard(terminal, PATIENCE, ends=ends))
    seconds = time.monotonic() - pressed
    over = bool(select.select([ends], [], [], 0)[0])
    status = int(os.read(ends, 20)) if over else None
    orphans = _alive(shell) - 1  # what stays is no orphan
    for process in _processes(shell):
        os.kill(process, signal.SIGKILL)
    os.waitpid(shell, 0)
    os.close(terminal), os.close(ends)
    return Ended(status, seconds, "".join(said), orphans)


def _stay_as_a_shell_does(words: Sequence[str], end: int) -> NoReturn:
    """Run a command, tell its exit status, and stay: else the terminal would end all its processes.

    What starts these tests may have turned Ctrl-C off for them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    command = os.fork()
    if not command:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        plain = {name: value for name, value in os.environ.items() if name != "NO_COLOR"}
        line = [sys.executable, "-m", "flexaxis.experiments", *words]
        os.execve(sys.executable, line, plain | {"TERM": "xterm"})  # else there may be no bar
    status = os.waitstatus_to_exitcode(os.waitpid(command, 0)[1])
    os.write(end, str(status).encode())
    while True:
        time.sleep(60)


def _heard(terminal: int, seconds: float, begun: str = "", *, ends: int | None = None) -> str:
    """Return what is said for some time, up to some word, or up to the end that is told."""
    end, text = time.monotonic() + seconds, ""
    while time.monotonic() < end and not (begun and begun in text):
        ready = select.select([terminal] + ([ends] if ends is not None else []), [], [], 0.05)[0]
        if terminal in ready:
            text += os.read(terminal, 65536).decode(errors="replace")
        elif ready:
            break
    return text


def _processes(session: int) -> list[int]:
    """Return the processes of a session, but for those that have ended."""
    listed = subprocess.run(
        ["ps", "-o", "pid=,stat=", "-s", str(session)], capture_output=True, text=True, check=False
    )
    lines = [line.split() for line in listed.stdout.splitlines()]
    return [int(number) for number, state in lines if not state.startswith("Z")]


def _alive(session: int) -> int:
    """Return how many processes of a session there still are, after a while."""
    end = time.monotonic() + ENDING
    while True:
        there = len(_processes(session))
        if there == 1 or time.monotonic() > end:
            return there
        time.sleep(0.1)


def last_lines(said: str, count: int = 8) -> str:
    """Return the end of what stood in a terminal, as a person sees it."""
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", said).replace("\r\n", "\n")
    lines = [line.rpartition("\r")[2] for line in text.split("\n")]
    return "\n".join(line for line in lines if line.strip()).split("\n", 1)[0] and "\n".join(
        [line.rstrip() for line in lines if line.strip()][-count:]
    )


def main() -> int:
    """Press, and print what was seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--after", type=float, default=6.0)
    args = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as place:
        for name, words in commands(Path(place)).items():
            if args.names and name not in args.names:
                continue
            for times in (1, 2):
                ended = press(words, times, args.after, BEGUN.get(name, BAR))
                print(f"--- {name}, Ctrl-C {'twice' if times == 2 else 'once'}")
                print(f"$ flexaxis {shlex.join(words)}")
                print(last_lines(ended.said))
                print(
                    f"[status {ended.status} {ended.seconds:.2f} s after the last Ctrl-C; "
                    f"{ended.orphans} processes left]\n",
                    flush=True,
                )
                wrong += ended.status not in (
                    (0, 130, -signal.SIGINT) if name == "demo" else (130,)
                )
                wrong += bool(ended.orphans)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
