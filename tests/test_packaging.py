"""What publishes: recipe, container and citation say what pyproject.toml and Makefile say."""

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
OTHER_NAMES = {"mujoco": "mujoco-python", "matplotlib": "matplotlib-base"}  # on conda-forge


def conda(requirement):
    """A requirement of pip as conda writes it."""
    name, bounds = re.fullmatch(r"([\w-]+)(.*)", requirement).groups()
    return f"{OTHER_NAMES.get(name, name)} {bounds}"


def test_the_recipe_needs_what_the_project_needs():
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    project, needs = PROJECT["project"], recipe["requirements"]
    python = f"python {project['requires-python']}"
    assert needs["run"] == [python, *map(conda, project["dependencies"])]
    assert needs["host"] == [python, "pip", *map(conda, PROJECT["build-system"]["requires"])]
    assert recipe["context"]["version"] == project["version"]
    assert recipe["about"]["license"] == project["license"]
    assert recipe["about"]["summary"] == project["description"]
    scripts = [f"{name} = {place}" for name, place in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert recipe["build"]["noarch"] == "python"
    home = (ROOT / "packaging/conda" / recipe["source"]["path"]).resolve()
    assert home == ROOT and (home / recipe["about"]["license_file"]).is_file()


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["project"]["version"]
    assert citation["license"] == PROJECT["project"]["license"]


def instructions():
    """The lines of the container file: word and the rest."""
    text = re.sub(r"\\\n", " ", (ROOT / "Containerfile").read_text(encoding="utf-8"))
    return [line.split(None, 1) for line in text.splitlines() if line and line[0] != "#"]


def test_the_container_holds_all_that_an_installation_reads():
    lines = instructions()
    assert lines[0][0] == "FROM" and lines[0][1].startswith("docker.io/library/python:3.")
    copied = {name for word, rest in lines if word == "COPY" for name in rest.split()[:-1]}
    assert all((ROOT / name).exists() for name in copied)
    project, folders = PROJECT["project"], PROJECT["tool"]["setuptools"]["package-dir"].values()
    needed = {project["readme"], *project["license-files"], "pyproject.toml", "Makefile"}
    assert copied == needed | {folder.split("/")[0] for folder in folders}


def test_the_container_makes_what_the_makefile_can_make():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8").replace("$(VENV)", ".venv")
    targets = {
        t for head in re.findall(r"^([^\s#:][^:=\n]*):", makefile, re.M) for t in head.split()
    }
    run = [shlex.split(rest) for word, rest in instructions() if word == "RUN"]
    command = next(json.loads(rest) for word, rest in instructions() if word == "CMD")
    made = [words[1] for words in [*run, command] if words[0] == "make"]
    assert made == [".venv/.core", "bench"] and {*made} <= targets
