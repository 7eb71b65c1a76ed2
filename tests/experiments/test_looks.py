"""Nine looks that anybody can tell apart, and who gets which."""

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.reporting import looks

APART = 20.0  # ΔE*76
CONTRAST = 3.0  # WCAG 2.1, 1.4.11
BACKS = {"light": looks.LIGHT_BACK, "dark": looks.DARK_BACK}
TEXTS = {"light": looks.LIGHT_TEXT, "dark": looks.DARK_TEXT}


@pytest.mark.parametrize("as_deuteranope", [False, True])
@pytest.mark.parametrize("variant", BACKS)
def test_colours_differ_from_each_other_and_from_text(variant, as_deuteranope):
    colours = [getattr(look, variant) for look in looks.NINE] + [TEXTS[variant]]
    found = looks.distances(colours, as_deuteranope=as_deuteranope)
    assert found[np.triu_indices(10, 1)].min() >= APART


@pytest.mark.parametrize("variant", BACKS)
def test_colours_are_seen_on_their_background(variant):
    for look in looks.NINE:
        assert looks.contrast(getattr(look, variant), BACKS[variant]) >= CONTRAST, look


def test_the_style_sheet_has_these_backgrounds():
    from importlib.resources import files

    sheet = files("flexaxis.experiments.reporting") / "templates/page.css"
    text = sheet.read_text(encoding="utf-8")
    assert f"--back: light-dark(#fff, {looks.DARK_BACK})" in text
    assert f"--text: light-dark(#222, {looks.DARK_TEXT})" in text


def test_dashes_and_markers_differ_too():
    assert len({look.marker for look in looks.NINE}) == 9
    unbroken = [look for look in looks.NINE if not look.dash]
    assert len({look.dash for look in looks.NINE}) == 8 and len(unbroken) == 2


def test_known_distances():
    """Against values worked out elsewhere: sRGB red and green in CIELAB, black on white."""
    np.testing.assert_allclose(looks.lab(looks.linear("#FF0000")), [53.24, 80.09, 67.20], atol=0.01)
    np.testing.assert_allclose(
        looks.lab(looks.linear("#00FF00")), [87.74, -86.18, 83.18], atol=0.01
    )
    assert looks.contrast("#000000", "#FFFFFF") == pytest.approx(21)
    assert looks.contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.005)


def test_a_deuteranope_sees_greys_as_they_are_and_mixes_up_red_and_green():
    grey = looks.linear("#808080")
    np.testing.assert_allclose(looks.deuteranope(grey), grey, atol=1e-6)
    seen = looks.distances(["#CC4444", "#7F7F2A"], as_deuteranope=True)[0, 1]
    assert seen < 0.4 * looks.distances(["#CC4444", "#7F7F2A"])[0, 1]


def test_any_nine_look_different_and_the_leading_ones_as_always():
    names = [name for name in REGISTRY if name not in looks.LEADING]
    page = [*looks.LEADING[:3], *names[:6]]
    found = looks.assigned(page)
    assert len({look.place for look in found.values()}) == 9
    assert [found[name] for name in page[:3]] == list(looks.NINE[:3])
    assert found == looks.assigned(reversed(page))
    assert looks.assigned(["frozen", "ukf"])["frozen"] == looks.NINE[-1]


def test_all_that_are_registered_look_different():
    found = looks.assigned(REGISTRY)
    assert list(found) == sorted(REGISTRY, key=lambda name: REGISTRY[name].rank)
    assert len(
        {(look.place, look.dash, look.marker, look.hollow) for look in found.values()}
    ) == len(found)


def test_two_settings_of_one_look_different():
    found = looks.assigned(["ekf[knob=2]", "ekf", "a.py:Mine"])
    assert found["ekf"] == looks.NINE[looks.LEADING.index("ekf")]
    assert len({look.place for look in found.values()}) == 3


def test_the_table_says_the_least():
    normal, deuteranope = [
        looks.distances([look.light for look in looks.NINE], as_deuteranope=x)[
            np.triu_indices(9, 1)
        ].min()
        for x in (False, True)
    ]
    assert f"normal {normal:.1f}, deuteranope {deuteranope:.1f}" in looks.table()
