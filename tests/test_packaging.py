"""The citation, the README and the CI workflow agree with pyproject.toml."""

import re
import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_names_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_the_workflow_runs_the_commands_that_the_readme_gives_without_make():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = re.search(r"```sh\n(python -m venv.*?)```", readme, re.DOTALL)[1].splitlines()
    windows = lines[1].split("Windows: ")[1]
    lines = [line.partition("#")[0].strip() for line in lines]
    flow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    job = flow["jobs"]["without-make"]
    run = job["steps"][-1]["run"].splitlines()
    cases = {case["os"]: case["activate"] for case in job["strategy"]["matrix"]["include"]}
    assert cases == {"macos-latest": lines[1], "windows-latest": windows}
    assert [lines[1] if "matrix.activate" in line else line for line in run] == lines
