"""The import arrows: experiments -> sim -> models_mjcf, experiments -> estimators."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAY_IMPORT = {
    "models_mjcf": set(),
    "sim": {"models_mjcf"},
    "estimators": set(),
    "experiments": {"models_mjcf", "sim", "estimators"},
}
# Usable alone on a robot's log: nothing but these.
ESTIMATORS_NEED = {"numpy", "scipy", "numba", "llvmlite"}
KNOW_MUJOCO = {"sim/plant.py", "experiments/reporting/view.py", "experiments/studies/speed.py"}
FILES = sorted(f for folder in MAY_IMPORT for f in (ROOT / folder).rglob("*.py"))


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_follow_the_arrows(path):
    folder = path.relative_to(ROOT).parts[0]
    names = imported(path)
    ours = {n.split(".")[1] for n in names if n.startswith("flexaxis.")}
    assert ours <= MAY_IMPORT[folder] | {folder}
    if "mujoco" in {n.split(".")[0] for n in names}:
        assert path.relative_to(ROOT).as_posix() in KNOW_MUJOCO
    if folder == "estimators":
        import sys

        others = {n.split(".")[0] for n in names} - set(sys.stdlib_module_names) - {"flexaxis"}
        assert others <= ESTIMATORS_NEED


def test_the_check_sees_a_wrong_arrow(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("from flexaxis.sim.plant import Plant\n")
    assert {n.split(".")[1] for n in imported(wrong)} == {"sim"}


def test_no_module_is_too_long():
    """A module that grows past this does more than one thing."""
    long = {
        f.name: n for f in FILES if (n := len(f.read_text(encoding="utf-8").splitlines())) > 330
    }
    assert not long
