"""The labs run, and their checks hold; a check bites if what it checks is broken."""

import re
import runpy
from pathlib import Path

import matplotlib
import pytest

LABS = sorted((Path(__file__).parents[1] / "docs" / "labs").glob("lab*.py"))


@pytest.fixture(autouse=True)
def no_window(monkeypatch):
    matplotlib.use("Agg")
    from matplotlib import pyplot

    monkeypatch.setattr(pyplot, "show", lambda: pyplot.close("all"))
    yield
    pyplot.close("all")


@pytest.mark.slow
@pytest.mark.parametrize("path", LABS, ids=lambda path: path.stem)
def test_lab_checks_itself(path, capsys):
    runpy.run_path(str(path))
    assert re.search(r"^check: .*\d", capsys.readouterr().out, re.MULTILINE)


def test_there_are_eight_and_the_page_names_them():
    page = LABS[0].with_name("README.md").read_text(encoding="utf-8")
    assert len(LABS) == 8
    assert [path.name for path in LABS] == re.findall(r"\]\((lab\d\.py)\)", page)


MISTAKES = {  # a typical slip, and the lab that must find it
    "lab1": ("-r * k_g / J_m, 0", "-k_g / J_m, 0"),
    "lab2": ("record.torque[-4000:],", "record.torque[-3900:],"),
    "lab3": (
        "P = steady_P(Q, forgetting=forgetting)",
        "P = 2 * steady_P(Q, forgetting=forgetting)",
    ),
    "lab4": ("drift_for([2.0, 2.0, tau], Q,", "drift_for([2.0, 2.0, 2 * tau], Q,"),
    "lab5": ("regularization=mu,", "regularization=mu / 2,"),
    "lab6": ("reset * rpem.P, 0.0", "rpem.P, 0.0"),
    "lab8": (
        '"control_fm_moves-v1").override(short)',
        '"control_fm_moves-v1").override(short | {"controller.adapt.friction": False})',
    ),
    "lab7": ("np.mean(abs(v)) / np.mean(v**2)", "np.mean(v**2) ** -0.5"),
}


@pytest.mark.parametrize(
    "path", [LABS[0], *(pytest.param(path, marks=pytest.mark.slow) for path in LABS[1:])]
)
def test_a_mistake_is_found(path, tmp_path):
    right, wrong = MISTAKES[path.stem]
    text = path.read_text(encoding="utf-8")
    assert right in text
    copy = tmp_path / path.name
    copy.write_text(text.replace(right, wrong), encoding="utf-8")
    with pytest.raises(AssertionError):
        runpy.run_path(str(copy))
