"""What is said of the published axis follows from its numbers."""

import re

import numpy as np
import pytest

from flexaxis.models_mjcf import model_files
from flexaxis.sim.parameters import preset

WG = preset("wg")
PAGE = model_files("three_mass")[1]["wg.md"].decode()
F_C, F_CS, ALPHA, BETA = 0.74302635727901, 3.98628540790595, 3.24015074090438, 0.79943497008153


def numbers(line):
    """The numbers of the list item that begins with a word."""
    (item,) = re.findall(rf"- {line}.*?(?=\n- |\Z)", PAGE, flags=re.DOTALL)
    return [float(word) for word in re.findall(r"\d+\.\d+|\d+", item)]


def matrices():
    mass = np.diag([WG.J_m, WG.J_g, WG.J_a])
    gear, arm = np.array([WG.r, -1, 0]), np.array([0, 1, -1])
    stiffness = WG.k_g * np.outer(gear, gear) + WG.k_a * np.outer(arm, arm)
    damping = WG.d_g * np.outer(gear, gear) + WG.d_a * np.outer(arm, arm)
    return mass, damping + np.diag([WG.f_m, WG.f_g, WG.f_a]), stiffness


def friction(v):
    return WG.f_m * v + (F_C + F_CS / np.cosh(ALPHA * v)) * np.tanh(BETA * v)


def test_the_page_states_the_set():
    stated = dict(re.findall(r"\| ([\w, ]+?) \| ([\d.e-]+) \|", PAGE))
    stated |= {name: stated["f_g, f_a"] for name in ("f_g", "f_a")}
    stated |= {name: stated["k_T, r"] for name in ("k_T", "r")}
    for name, value in WG.as_dict().items():
        rounded = 1e-4 if name.startswith("J") else 1e-15  # the parts of J are products
        assert float(stated[name]) == pytest.approx(value, rel=rounded)
    assert WG.J_m + WG.J_g + WG.J_a == pytest.approx(0.03291699877416, rel=1e-15)
    curve = re.findall(r"\| `(\w+)` \| ([\d.]+) \|", PAGE)
    assert [float(value) for _, value in curve] == [F_C, F_CS, ALPHA, BETA]


def test_modes_and_antiresonances():
    mass, damping, stiffness = matrices()
    low = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
    poles = np.linalg.eigvals(np.vstack([np.eye(3, 6, 3), low]))
    modes = sorted(poles[poles.imag > 1], key=abs)
    found = [value for pole in modes for value in (abs(pole) / (2 * np.pi), -pole.real / abs(pole))]
    held = np.linalg.eigvals(np.linalg.solve(mass[1:, 1:], stiffness[1:, 1:]))
    found += sorted(np.sqrt(held))
    assert numbers("Without") == pytest.approx(found, rel=0.02)
    assert [round(value.real, 1) for value in found[-2:]] == numbers("Without")[-2:]


def test_the_friction_curve():
    stated = numbers("Friction")
    speeds = np.linspace(0.1, 1, 1801)
    peak = speeds[friction(speeds).argmax()]
    assert stated[2:4] == pytest.approx([friction(peak), peak], abs=0.005)
    at = [0.2, 1, 10, 50, 100]
    assert [stated[1], *stated[5:12:2]] == at
    assert [stated[0], *stated[4:11:2]] == pytest.approx(list(friction(np.array(at))), abs=0.005)
    assert stated[12] == round(F_C / WG.f_m)
    assert numbers("It is smooth") == [pytest.approx((F_C + F_CS) * BETA, abs=0.005)]
