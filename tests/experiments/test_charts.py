"""Charts as data: what is refused, and that what is packed comes out again."""

import base64
import json
import struct
import zlib

import numpy as np
import pytest

from flexaxis.experiments.reporting import page, script
from flexaxis.experiments.reporting.charts import (
    Cells,
    Chart,
    ChartError,
    Heat,
    Line,
    Panel,
    Pick,
    Picks,
)
from flexaxis.experiments.reporting.packing import packed


def unpacked(text):
    """What assets/data.js does, from what `packing` says of the block."""
    block = zlib.decompress(base64.b64decode(text))
    (n,) = struct.unpack("<I", block[:4])
    heap = block[4 + n :]
    return json.loads(block[4 : 4 + n], object_hook=lambda value: numbers(value, heap))


def numbers(value, heap):
    if "array" not in value:
        return value
    kind, offset, length, low, step = value["array"]
    if kind == "even":
        return low + step * np.arange(length)
    size = {"i2": 2, "f4": 4}[kind]
    raw = np.frombuffer(heap[offset : offset + size * length], np.uint8)
    found = raw.reshape(size, length).T.copy().view("<" + kind)[:, 0]
    if kind == "f4":
        return found
    level = np.cumsum(found.astype(np.int64)).astype("<i2").astype(float)
    return np.where(level == -32768, np.nan, low + step * level)


def test_what_is_packed_comes_out_again():
    rng = np.random.default_rng(1)
    smooth = np.cumsum(rng.standard_normal(1000))
    gaps = np.where(rng.random(1000) < 0.1, np.nan, smooth)
    given = {
        "even": np.linspace(0, 20, 401),
        "smooth": smooth,
        "gaps": gaps,
        "short": np.array([1.5, np.nan, 1e-9]),
        "words": ["f_m", None, True, 3],
    }
    found = unpacked(packed(given))
    np.testing.assert_allclose(found["even"], given["even"], atol=1e-9)
    span = np.nanmax(smooth) - np.nanmin(smooth)
    for name in ("smooth", "gaps"):
        np.testing.assert_allclose(found[name], given[name], rtol=0, atol=0.51 * span / 65000)
    assert found["short"] == [1.5, None, 1e-9]
    assert found["words"] == given["words"]


def test_a_burst_does_not_make_the_rest_coarse():
    y = 1 + 0.001 * np.random.default_rng(2).standard_normal(1000)
    y[500] = 1e6
    found = unpacked(packed({"y": y}))["y"]
    np.testing.assert_allclose(found, y, rtol=1e-7)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("least", [5e-324, 1e-310])
def test_numbers_next_to_nought_have_no_grid(least):
    y = np.r_[0.0, least, 1.0, 2.0]
    np.testing.assert_allclose(unpacked(packed({"y": y}))["y"], y, atol=1e-4)


def test_what_is_the_same_lies_there_once():
    y = np.random.default_rng(3).standard_normal(5000)
    assert len(packed([y, y, y])) < 1.02 * len(packed([y]))


def test_a_line_needs_as_many_of_each():
    x = np.arange(3.0)
    with pytest.raises(ChartError, match=r"^low of line 'ekf' has shape \(2,\) and x \(3,\)"):
        Line(who="ekf", x=x, y=x, low=x[:2], high=x)
    with pytest.raises(ChartError, match=r"^line 'ekf': give both ends or neither$"):
        Line(who="ekf", x=x, y=x, low=x)


def test_ranges_go_upwards():
    x = np.arange(3.0)
    with pytest.raises(ChartError, match="low before high"):
        Panel(y="f_m", lines=[Line(x=x, y=x)], y_range=(2, 1))
    with pytest.raises(ChartError, match="'whole' is 3 … 1"):
        chart("t", windows=[("whole", 3, 1)])


def test_a_map_has_a_value_for_each_cell():
    with pytest.raises(ChartError, match=r"have shape \(3, 2\): give \(2, 3\)"):
        Heat(title="t", words="", x="x", y="y", xs=(1, 2, 3), ys=(1, 2),
             panels=[Cells(values=np.zeros((3, 2)))])  # fmt: skip


def chart(title, who="ekf", **more):
    x = np.arange(3.0)
    line = Line(who=who, x=x, y=x)
    return Chart(title=title, words="", x="x", panels=[Panel(y="y", lines=[line])], **more)


TEMPLATE = """{% extends "reporting/templates/page.html" %}{% block body %}
{% for c in charts %}{{ c.html }}{% endfor %}
<tr data-who="a&amp;b">{{ "lag"|term }}{% endblock %}"""


@pytest.fixture
def block(monkeypatch):
    """A function that renders a page with some content and returns its data."""
    page._environment.cache_clear()  # one made before reads as ordinary
    source = page._source
    monkeypatch.setattr(page, "_source", lambda name: TEMPLATE if name == "t" else source(name))

    def render(**content):
        html = page.render("t", content)
        return unpacked(html.partition('id="page-data">')[2].partition("<")[0])

    yield render
    page._environment.cache_clear()


def test_a_page_has_its_charts_picks_looks_and_terms(block):
    picks = Picks({"7": Pick(title="Seed 7", charts=[chart("inside", "imm")])})
    found = block(charts=page.charted([chart("One & Two")]), deep=[{"picks": picks}])
    assert list(found["charts"]) == ["one-two"]
    assert found["charts"]["one-two"]["panels"][0]["lines"][0]["y"] == [0, 1, 2]
    assert found["picks"]["7"]["charts"][0]["title"] == "inside"
    assert set(found["looks"]) == {"ekf", "imm", "a&b"}
    assert set(found["terms"]) == {"lag"}


def test_two_charts_of_one_name_are_refused(block):
    with pytest.raises(ChartError, match="two charts of a page are named 'same'"):
        block(charts=page.charted([chart("Same"), chart("same")]))


def test_an_unknown_term_is_refused():
    with pytest.raises(ChartError, match="no term 'lagg' in the glossary"):
        page.term("lagg")


def test_the_policy_names_the_script_that_is_there():
    import hashlib

    html = page.render("reporting/templates/page.html", {})
    code = html.partition("<script>")[2].rpartition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    assert f"script-src &#39;sha256-{digest}&#39;" in html
    assert "</script" not in script.source().lower()


def test_files_of_code_are_short():
    """As modules are: one thing each; no function longer than 60 lines."""
    import re
    from importlib.resources import files

    folder = files("flexaxis.experiments.reporting") / "assets"
    there = {each.name for each in folder.iterdir() if each.name.endswith(".js")}
    assert there == {f"{name}.js" for name in script.PARTS}
    for name in there:
        text = (folder / name).read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 300, name
        for body in re.findall(r"^(?:async )?function .*?^}", text, re.M | re.S):
            assert len(body.splitlines()) <= 60, body[:60]
        assert "innerHTML" not in text and "eval(" not in text, name


def test_no_two_files_of_code_use_one_name():
    """They are one script: a name declared twice would stop all of it."""
    import re

    names = re.findall(r"^(?:async )?(?:function|const|let|class) (\w+)", script.source(), re.M)
    assert len(names) > 100
    assert {name for name in names if names.count(name) > 1} == set()
