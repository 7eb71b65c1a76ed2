"""Nine styles that anybody can tell apart, and who gets which."""

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.reporting import styles

APART = 20.0  # ΔE*76
CONTRAST = 3.0  # WCAG 2.1, 1.4.11
BACKS = {"light": styles.BACK, "dark": styles.DARK_BACK}
TEXTS = {"light": styles.TEXT, "dark": styles.DARK_TEXT}


# D65 white, sRGB primaries (IEC 61966-2-1).
_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
# Machado, Oliveira and Fernandes (2009), table 1: deuteranopia, severity 1, on linear RGB.
_DEUTERANOPE = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)


def linear(colour):
    """Return a colour such as ``"#0072B2"`` as linear RGB, 0 … 1."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def deuteranope(rgb):
    """Return linear RGB as a deuteranope sees it."""
    return np.clip(_DEUTERANOPE @ rgb, 0, 1)


def lab(rgb):
    """Return linear RGB as CIELAB 1976, for D65."""
    t = (_TO_XYZ @ rgb) / (_TO_XYZ @ np.ones(3))
    x, y, z = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def distances(colours, *, as_deuteranope=False):
    """Return ΔE*76 between any two colours, shape (n, n)."""
    rgb = [linear(colour) for colour in colours]
    seen = np.array([lab(deuteranope(each) if as_deuteranope else each) for each in rgb])
    return np.linalg.norm(seen[:, None] - seen[None], axis=2)


def contrast(colour, back):
    """Return the contrast of two colours after WCAG 2.1: 1 for equal ones, 21 at most."""
    low, high = sorted(float(_TO_XYZ[1] @ linear(each)) for each in (colour, back))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("as_deuteranope", [False, True])
@pytest.mark.parametrize("variant", BACKS)
def test_colours_differ_from_each_other_and_from_text(variant, as_deuteranope):
    colours = [getattr(style, variant) for style in styles.NINE] + [TEXTS[variant]]
    found = distances(colours, as_deuteranope=as_deuteranope)
    assert found[np.triu_indices(10, 1)].min() >= APART


@pytest.mark.parametrize("variant", BACKS)
def test_colours_are_seen_on_their_background(variant):
    for style in styles.NINE:
        assert contrast(getattr(style, variant), BACKS[variant]) >= CONTRAST, style


def test_dashes_and_markers_differ_too():
    assert len({style.marker for style in styles.NINE}) == 9
    unbroken = [style for style in styles.NINE if not style.dash]
    assert len({style.dash for style in styles.NINE}) == 8 and len(unbroken) == 2


def test_known_distances():
    """Against values worked out elsewhere: sRGB red and green in CIELAB, black on white."""
    np.testing.assert_allclose(lab(linear("#FF0000")), [53.24, 80.09, 67.20], atol=0.01)
    np.testing.assert_allclose(lab(linear("#00FF00")), [87.74, -86.18, 83.18], atol=0.01)
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21)
    assert contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.005)


def test_two_settings_of_one_look_different():
    found = styles.assigned(["ekf[knob=2]", "ekf", "a.py:Mine", "imm"])
    assert (found["ekf"], found["imm"]) == (styles.style("ekf"), styles.style("imm"))
    assert len({style.place for style in found.values()}) == 4
    every = styles.assigned(REGISTRY).values()
    assert len({(s.place, s.dash, s.marker, s.hollow) for s in every}) == len(REGISTRY)
