"""The import arrows: experiments -> sim -> models_mjcf, experiments -> estimators."""

import ast
from graphlib import CycleError, TopologicalSorter
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
ESTIMATORS_NEED = {"numpy", "scipy", "numba"}
# For whoever has more installed: imported inside a function, with a clear error where it lacks.
ESTIMATORS_MAY_USE = {"estimators/models/axis_models.py": {"pydantic"}}
KNOW_MUJOCO = {
    "sim/plant/plant.py",
    "sim/plant/callback.py",
    "experiments/demo/view.py",
}
FILES = sorted(f for folder in MAY_IMPORT for f in (ROOT / folder).rglob("*.py"))


def imported(path: Path, *, types: bool = True) -> set[str]:
    """Return what is imported, inside functions too; without types, not what is for these alone."""
    names, tree = set(), ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING" and not types:
            node.body = []
    for node in ast.walk(tree):
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
    if path.parent.name == "front":  # its modules are those of the package itself
        ours = {name for name in ours if not name.startswith("_")}
    else:
        outside = path.parent.parent.name == "commands" or path.parent.name == "commands"
        assert outside or "flexaxis" not in names, "only commands call `fx`"
        ours = {name for name in ours if not (outside and name.startswith("_"))}
    assert ours <= MAY_IMPORT[folder] | {folder}
    place = path.relative_to(ROOT).as_posix()
    if "mujoco" in {n.split(".")[0] for n in names}:
        assert place in KNOW_MUJOCO
    if folder == "estimators":
        import sys

        others = {n.split(".")[0] for n in names} - set(sys.stdlib_module_names) - {"flexaxis"}
        assert others <= ESTIMATORS_NEED | ESTIMATORS_MAY_USE.get(place, set())


COMMANDS_MAY = (
    "flexaxis.sim.errors", "flexaxis.experiments.commands.",
    "flexaxis.experiments.files",
    "flexaxis.experiments.logs.options", "flexaxis.experiments.reporting.terminal",
)  # fmt: skip
"""Files and errors; what `answer` cannot print; options of logs, as they are declared."""


@pytest.mark.parametrize(
    "path", [*(ROOT / "experiments/commands").glob("*.py")], ids=lambda p: p.stem
)
def test_commands_call_fx(path):
    ours = {name for name in imported(path) if name.startswith("flexaxis.")}
    assert not {name for name in ours if not name.startswith(COMMANDS_MAY)}


def test_the_check_sees_a_wrong_arrow(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("from flexaxis.sim.plant.plant import Plant\n")
    assert {n.split(".")[1] for n in imported(wrong)} == {"sim"}


def circle(files: list[Path], root: Path) -> None:
    """Raise a CycleError where modules import each other in a circle, in functions or not."""
    modules = {
        ".".join(("flexaxis", *f.relative_to(root).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): f
        for f in files
    }
    TopologicalSorter(
        {
            name: {n if n in modules else n.rpartition(".")[0] for n in imported(f, types=False)}
            & modules.keys() - {name}
            for name, f in modules.items()
        }
    ).prepare()


def test_no_modules_import_each_other():
    circle(FILES, ROOT)


def test_a_circle_is_seen_inside_functions_but_not_of_types(tmp_path):
    one, other = tmp_path / "one.py", tmp_path / "other.py"
    one.write_text("from flexaxis.other import x\n")
    other.write_text("if TYPE_CHECKING:\n    from flexaxis.one import x\n")
    circle([one, other], tmp_path)
    other.write_text("def f():\n    from flexaxis.one import x\n")
    with pytest.raises(CycleError):
        circle([one, other], tmp_path)


def test_no_module_is_too_long():
    """A module that grows past this does more than one thing."""
    long = {
        f.name: n for f in FILES if (n := len(f.read_text(encoding="utf-8").splitlines())) > 400
    }
    assert not long
