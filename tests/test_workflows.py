"""The workflows that meet other people's code: what they may do, and what they must not."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

HOME = Path(__file__).parents[1] / ".github"
CHECK, COMMENT = "board-check", "board-comment"


def read(name):
    found = yaml.safe_load((HOME / "workflows" / f"{name}.yml").read_text(encoding="utf-8"))
    found["on"] = found.pop(True)  # YAML 1.1 takes `on` for a truth value
    return found


def steps(flow):
    return [step for job in flow["jobs"].values() for step in job["steps"]]


def text(name):
    return (HOME / "workflows" / f"{name}.yml").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", sorted((HOME / "workflows").glob("*.yml")), ids=lambda p: p.stem)
def test_no_workflow_gives_a_request_the_rights_of_the_repository(path):
    flow = read(path.stem)
    triggers = flow["on"] if isinstance(flow["on"], dict) else {flow["on"]: None}
    assert "pull_request_target" not in triggers
    for step in steps(flow):
        if "uses" in step:
            assert re.fullmatch(r"[\w./-]+@(v\d+|[0-9a-f]{40})", step["uses"])
        # what a request says never becomes part of a script
        assert not re.search(r"\$\{\{\s*github\.(event|head_ref)", step.get("run", ""))


def test_the_check_only_reads_and_has_no_secrets():
    flow = read(CHECK)
    assert [*flow["on"]] == ["pull_request"] and flow["permissions"] == {"contents": "read"}
    assert "secrets." not in text(CHECK) and "GITHUB_TOKEN" not in text(CHECK)
    assert all(
        "timeout-minutes" in job and "permissions" not in job for job in flow["jobs"].values()
    )
    for step in steps(flow):
        if step.get("uses", "").startswith("actions/checkout"):
            assert step["with"]["persist-credentials"] is False
    install = next(s["run"] for s in steps(flow) if "pip install" in s.get("run", ""))
    assert install.split()[-1] == "./trusted"  # of the branch it goes to, not of the request


def test_the_comment_is_posted_as_data():
    flow = read(COMMENT)
    assert [*flow["on"]] == ["workflow_run"]
    assert flow["permissions"] == {"actions": "read", "pull-requests": "write"}
    uses = [step["uses"].partition("@")[0] for step in steps(flow) if "uses" in step]
    assert uses == ["actions/download-artifact", "actions/github-script"]  # nothing checked out
    assert not any("run" in step for step in steps(flow))
    script = steps(flow)[1]["with"]["script"]
    assert "${{" not in script  # nothing of the request is put into the code
    assert re.search(r"\[1-9\]\[0-9\]\{0,8\}", script) and "head.sha !== process.env" in script
    assert "30000" in script and "eval" not in script and "exec" not in script


def test_folders_of_entries_are_found_and_nothing_else():
    names = ["entries/mine/entry.json", "entries/mine/run/scores.jsonl", "README.md"]
    names += ["entries/../x/y", "entries/a;rm/x", "entries/.hidden/x", "entries/two/x\ny"]
    found = subprocess.run(
        [sys.executable, HOME / "board_entries.py"], input="\0".join(names).encode(),
        capture_output=True, check=True,
    )  # fmt: skip
    assert found.stdout.decode().split() == ["entries/mine", "entries/.hidden", "entries/two"]
    many = subprocess.run(
        [sys.executable, HOME / "board_entries.py"], capture_output=True, check=False,
        input="\0".join(f"entries/n{i}/x" for i in range(9)).encode(),
    )  # fmt: skip
    assert many.returncode and b"5 are allowed" in many.stderr
