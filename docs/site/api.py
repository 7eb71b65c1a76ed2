"""The pages of the Python reference: what of the package is public, and where it is told."""

from __future__ import annotations

import inspect
from pathlib import Path
from types import ModuleType

import flexaxis as fx
from flexaxis import estimators as package

FRONT = {
    "Simulate": ("simulate", "load", "make_axis", "Recording", "Axis", "Sample"),
    "Estimate and score": ("estimate", "score", "Estimate"),
    "Many runs": ("benchmark", "study", "Results"),
    "Judge": ("compare", "check", "Comparison"),
    "Logs of an axis": ("import_log", "identify", "track", "trend", "LogResult"),
    "What there is": ("scenarios", "view", "cache"),
}
"""What `import flexaxis as fx` gives, in the order in which it is read; tested to be all of it."""

ELSEWHERE = {
    "flexaxis.estimators.protocol": ("Estimator", "StepError", "run_estimator"),
    "flexaxis.estimators.registry": ("Entry",),
}
"""What extensions rely on besides."""


def write(folder: Path) -> None:
    """Write the two pages into a folder of sources."""
    place = folder / "reference"
    place.mkdir(parents=True, exist_ok=True)
    (place / "api.rst").write_text(front_page(), encoding="utf-8")
    (place / "estimators-api.rst").write_text(estimators_page(), encoding="utf-8")


def front_page() -> str:
    """Return the page of ``import flexaxis as fx``."""
    parts = [
        heading("Python reference", "="),
        "``import flexaxis as fx``; how it is used: :doc:`/python`.",
        ".. toctree::\n   :hidden:\n\n   estimators-api",
        "Estimators as classes, for one's own data: :doc:`estimators-api`.",
    ]
    for title, names in FRONT.items():
        parts += [heading(title, "-"), *(entry("flexaxis", name, fx) for name in names)]
    return "\n\n".join([*parts, _listed()]) + "\n"


def _listed() -> str:
    """Return what is said of `fx.estimators`, which is a package and can be called."""
    words = (inspect.getdoc(type(fx.estimators).__call__) or "").partition("\n\n")[0]
    return (
        f".. py:function:: flexaxis.estimators(*, find='')\n\n   {words}\n\n"
        "   The same name is the package of the estimators, :doc:`estimators-api`."
    )


def estimators_page() -> str:
    """Return the page of ``flexaxis.estimators``, and of what extensions rely on."""
    name = package.__name__
    parts = [
        heading("Estimators as classes", "="),
        "For one's own data and loops: NumPy, SciPy and Numba are all that these need. All "
        "registered ones by name: :doc:`estimators`.",
        f".. autodata:: {name}.RECOMMENDED",
        *(entry(name, each, package) for each in package.__all__ if each != "RECOMMENDED"),
        heading("What an estimator is", "-"),
        "The rules in words: :doc:`/extending`.",
    ]
    for module, names in ELSEWHERE.items():
        parts += [entry(module, each, _module(module)) for each in names]
    return "\n\n".join(parts) + "\n"


def heading(title: str, line: str) -> str:
    """Return a heading in reStructuredText."""
    return f"{title}\n{line * len(title)}"


def entry(module: str, name: str, home: ModuleType) -> str:
    """Return the directive that tells of a name; of a class with what is public in it."""
    found = getattr(home, name)
    if not isinstance(found, type):
        return f".. autofunction:: {module}.{name}"
    kind = "autoexception" if issubclass(found, Exception) else "autoclass"
    members = "" if kind == "autoexception" else "\n   :members:\n   :inherited-members:"
    made = "()" if module == "flexaxis" else ""  # by functions: nobody gives these arguments
    return f".. {kind}:: {module}.{name}{made}{members}"


def _module(name: str) -> ModuleType:
    from importlib import import_module

    return import_module(name)
