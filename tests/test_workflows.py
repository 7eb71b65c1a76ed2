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
            assert re.fullmatch(r"[\w./-]+@((release/)?v\d+|[0-9a-f]{40})", step["uses"])
        # what a request says never becomes part of a script
        assert not re.search(r"\$\{\{\s*github\.(event|head_ref)", step.get("run", ""))


def test_what_the_readme_says_for_who_has_no_make_is_tried():
    readme = (HOME.parent / "README.md").read_text(encoding="utf-8")
    told = re.search(r"```sh\n(python -m venv.*?)```", readme, re.DOTALL)[1].splitlines()
    told, windows = [line.partition("#")[0].strip() for line in told], told[1].split("Windows: ")[1]
    job = read("ci")["jobs"]["without-make"]
    run = job["steps"][-1]["run"].splitlines()
    cases = {case["os"]: case["activate"] for case in job["strategy"]["matrix"]["include"]}
    assert cases == {"macos-latest": told[1], "windows-latest": windows}
    assert [told[1] if "matrix.activate" in line else line for line in run] == told


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


def test_a_comment_needs_a_request_of_entries_only():
    """Else the request would bring the workflow that says it was accepted."""
    script = steps(read(COMMENT))[1]["with"]["script"]
    before = script.partition("createComment")[0]
    for needed in ("pulls.listFiles", 'startsWith("entries/")', "f.previous_filename"):
        assert needed in before
    assert "request.data.changed_files" in before
    assert '".github/workflows/board-check.yml"' in before


def test_nothing_is_run_where_code_cannot_be_shut_in():
    runs = [step.get("run", "") for step in steps(read(CHECK))]
    first = next(k for k, run in enumerate(runs) if "install --yes bubblewrap" in run)
    assert first < next(k for k, run in enumerate(runs) if "--run-code" in run)
    assert not any("|| true" in run for run in runs[: first + 1])
    assert not any("--unconfined" in run for run in runs)
    assert "--no-renames" in "".join(runs) and "--diff-filter" not in "".join(runs)


def folders(names, home):
    """What is printed for names of changed files, and what is said."""
    found = subprocess.run(
        [sys.executable, HOME / "board_entries.py", home], capture_output=True, check=False,
        input="".join(f"{name}\0" for name in names).encode(),
    )  # fmt: skip
    return found.returncode, found.stdout.decode().split(), found.stderr.decode()


def test_folders_of_entries_are_found(tmp_path):
    for name in ("mine", "two"):
        (tmp_path / "entries" / name).mkdir(parents=True)
    names = ["entries/mine/entry.json", "entries/mine/rows.jsonl", "entries/two/x\ny"]
    assert folders(names, tmp_path) == (0, ["entries/mine", "entries/two"], "")
    code, found, said = folders([*names, "entries/gone/entry.json"], tmp_path)
    assert (code, found) == (0, ["entries/mine", "entries/two"]) and "gone: removed" in said
    code, found, said = folders(["entries/gone/entry.json"], tmp_path)
    assert code and not found and "no entry to verify" in said
    assert folders([], tmp_path)[0]
    code, _, said = folders([f"entries/n{i}/x" for i in range(9)], tmp_path)
    assert code and "5 are allowed" in said


@pytest.mark.parametrize(
    "name",
    ["entries/with space/entry.json", "entries/../x/y", "entries/a;rm/x", "entries/.hidden/x",
     "entries/file", "README.md", "entries/mу/x"],
)  # fmt: skip
def test_a_name_that_is_none_of_an_entry_ends_the_check(name, tmp_path):
    (tmp_path / "entries" / "mine").mkdir(parents=True)
    code, found, said = folders(["entries/mine/entry.json", name], tmp_path)
    assert code and not found and "is no file of an entry" in said
