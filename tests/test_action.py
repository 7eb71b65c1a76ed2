"""The gate as an action of GitHub: its steps, run here as a runner runs them, on three changes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

HOME = Path(__file__).parents[1] / ".github" / "actions" / "gate"
ACTION = yaml.safe_load((HOME / "action.yml").read_text(encoding="utf-8"))
SMALL = "--strict --seeds 1000:1016 fm_step-v1"
LATE = '''
from flexaxis.estimators.registry import REGISTRY


class Mine:
    """The paper's method, told late."""

    output = "speed"

    def __init__(self, nominal, period):
        self._filter = REGISTRY["rpem-forgetting"].factory(nominal, period, forgetting={forgetting})
        self.names, self._told, self._k = self._filter.names, [], 0

    def step(self, u, y):
        self._k += 1
        if {raises} and self._k == 2500:
            raise RuntimeError("out of range")
        self._told = [*self._told, self._filter.step(u, y).copy()][-1 - {late} :]
        return self._told[0]
'''


def steps():
    return [step for step in ACTION["runs"]["steps"] if "run" in step]


def run_action(folder, *, base, candidate, arguments=SMALL):
    """Run the steps of the action but the installation; return statuses and the summary."""
    inputs = {"base": base, "candidate": candidate, "arguments": arguments}
    statuses, summary = {}, folder / "summary.md"
    for step in steps():
        if "pip install" in step["run"] or (any(statuses.values()) and "if" not in step):
            continue
        given = {
            key: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda m: inputs[m[1]], value)
            for key, value in step.get("env", {}).items()
        }
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        env = os.environ | given | {"GITHUB_STEP_SUMMARY": str(summary), "PATH": path}
        command = ["bash", "-eo", "pipefail", "-c", step["run"]]
        done = subprocess.run(command, cwd=folder, env=env, check=False, capture_output=True)
        statuses[step["name"]] = done.returncode
    return statuses, summary.read_text(encoding="utf-8") if summary.exists() else ""


def write(folder, **options):
    folder.mkdir()
    (folder / "mine.py").write_text(LATE.format(**{"raises": False, "forgetting": 0.98} | options))
    return f"{folder.name}/mine.py:Mine"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "status", "word"),
    [
        ({"late": 0, "forgetting": 0.99}, 0, "better"),
        ({"late": 400}, 1, "worse"),
        ({"late": 200, "raises": True}, 70, "out of range"),
    ],
    ids=["better", "worse", "crash"],
)
def test_three_changes(options, status, word, tmp_path):
    base, candidate = (
        write(tmp_path / name, **given)
        for name, given in (("base", {"late": 200}), ("candidate", options))
    )
    statuses, summary = run_action(tmp_path, base=base, candidate=candidate)
    assert max(statuses.values()) == status, statuses
    assert word in summary.lower(), summary


def test_what_is_given_is_never_part_of_a_script():
    assert all("${{" not in step["run"] for step in steps())
    for step in ACTION["runs"]["steps"]:
        assert re.fullmatch(r"actions/[\w-]+@v\d+", step.get("uses", "actions/x@v1"))
    assert set(ACTION["inputs"]) == {"base", "candidate", "arguments"}
    assert "--strict --max-seeds" in ACTION["inputs"]["arguments"]["default"]
