"""Charts: what is refused, and that a page has what it was given, drawn, without a script."""

import base64

import numpy as np
import pytest

from flexaxis.experiments.reporting.charts_old import page
from flexaxis.experiments.reporting.charts_old.charts import (
    Chart,
    ChartError,
    Line,
    Panel,
    Pick,
)
from flexaxis.experiments.reporting.charts_old.drawing import drawn
from flexaxis.experiments.reporting.charts_old.marks import css_class
from flexaxis.experiments.reporting.charts_old.scales import Scale, upward
from flexaxis.experiments.reporting.charts_old.shapes import SLACK, UNITS
from tests.experiments.page_data import charts_of, lines, page_data


def shown(*given, **more):
    """The one panel of a chart with some lines, as the page has it."""
    chart = Chart(title="t", words="", x="x", panels=[Panel(y="y", lines=given)], **more)
    ((view,),) = charts_of(str(drawn(chart, "t"))).values()
    return view["panels"][0]


def test_a_curve_is_drawn_where_it_is():
    rng = np.random.default_rng(1)
    x = np.linspace(0, 20, 800)
    y = np.cumsum(rng.standard_normal(800))
    panel = shown(Line(x=x, y=y, who="ekf"))
    (line,) = panel["lines"]
    off = np.interp(x, line["x"], line["y"]) - np.clip(y, panel["low"], panel["high"])
    inside = (y > panel["low"]) & (y < panel["high"])
    assert abs(off[inside]).max() < 1.2 * SLACK / UNITS * (panel["high"] - panel["low"])


def test_a_straight_line_takes_two_points_and_a_gap_cuts_it():
    x = np.arange(1000.0)
    (line,) = shown(Line(x=x, y=2 * x))["lines"]
    assert len(line["x"]) == 2
    y = np.where((x > 400) & (x < 600), np.nan, x)
    (line,) = shown(Line(x=x, y=y))["lines"]
    assert line["x"] == pytest.approx([0, 400, 600, 999], abs=0.1)


def test_a_spike_is_not_lost():
    x = np.arange(100_000.0)
    y = np.where(x == 31_234, 7.0, 0.0)
    (line,) = shown(Line(x=x, y=y), name="spike")["lines"]
    panel = Panel(y="y", lines=[Line(x=x, y=y)], y_range=(-1, 8))
    chart = Chart(title="t", words="", x="x", panels=[panel])
    ((view,),) = charts_of(str(drawn(chart, "t"))).values()
    (line,) = view["panels"][0]["lines"]
    assert max(line["y"]) == pytest.approx(7, abs=0.01) and len(line["x"]) < 2100


def test_a_window_of_steps_sees_the_last_before_it_and_none_earlier():
    x = np.array([0.0, 1.0, 2.0, 8.0])
    line = Line(x=x, y=np.array([50.0, 9.0, 2.0, 3.0]), kind="steps", role="truth")
    scale = upward(Panel(y="y", lines=(line,)), Scale(4.0, 10.0))
    assert scale.low < 2.0 and 3.0 < scale.high < 4.0


def test_steps_keep_a_value_until_the_next():
    (line,) = shown(Line(x=np.array([0.0, 6.0, 8.0]), y=np.array([1.0, 1.5, 1.5]), kind="steps",
                         role="truth", label="truth"))["lines"]  # fmt: skip
    assert line["x"] == pytest.approx([0, 6, 6, 8, 8], abs=0.01)
    assert line["y"] == pytest.approx([1, 1, 1.5, 1.5, 1.5], abs=0.001)


def test_points_say_their_values_and_ends_exactly():
    x = np.array([1.23456, 2.0, np.nan])
    line = Line(x=x, y=2 * x, low=x, high=3 * x, kind="points", who="ekf")
    (found,) = shown(line)["lines"]
    np.testing.assert_allclose(
        found["values"][0], [1.23456, 2.46912, 1.23456, 3.70368, np.nan, np.nan]
    )


def test_both_windows_are_views_and_a_line_is_cut_to_each():
    x = np.linspace(0, 20, 401)
    panel = Panel(y="y", lines=[Line(x=x, y=x, who="ekf")])
    windows = [("near", 9.9, 11.0), ("whole", 0.0, 20.0)]
    chart = Chart(title="t", words="", x="x", panels=[panel], windows=windows)
    (views,) = charts_of(str(drawn(chart, "t"))).values()
    assert [(v["window"], v["from"], v["to"]) for v in views] == windows
    near = views[0]["panels"][0]["lines"][0]
    assert near["x"].min() <= 9.9 and near["x"].max() >= 11.0 and near["x"].max() < 11.2


@pytest.mark.parametrize(
    ("scale", "texts"),
    [
        (Scale(0, 1), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (Scale(-3, 3), ["−3", "−2", "−1", "0", "1", "2", "3"]),
        (Scale(0.1, 10, log=True), ["0.1", "0.2", "0.5", "1", "2", "5", "10"]),
        (Scale(1, 1e4, log=True), ["1", "10", "100", "1000", "1e4"]),
        (Scale(0, 60, origin="2026-01-01"), ["1 Jan 2026", "Feb", "Mar"]),
    ],
)
def test_ticks_are_round(scale, texts):
    assert [text for _, text in scale.ticks] == texts


def test_a_burst_does_not_set_the_scale():
    x = np.arange(1000.0)
    y = np.where(x == 500, 1e6, np.sin(x))
    assert shown(Line(x=x, y=y))["high"] < 2
    whole = Panel(y="y", lines=[Line(x=x, y=y)], whole=True)
    html = str(drawn(Chart(title="t", words="", x="x", panels=[whole]), "t"))
    ((view,),) = charts_of(html).values()
    assert view["panels"][0]["high"] > 1e6


def chart(title, who="ekf", **more):
    x = np.arange(3.0)
    line = Line(who=who, x=x, y=x)
    return Chart(title=title, words="", x="x", panels=[Panel(y="y", lines=[line])], **more)


TEMPLATE = """{% extends "reporting/charts_old/templates/page.html" %}{% block body %}
{% for c in charts %}{{ c|drawn }}{% endfor %}
<tr data-who="a&amp;b">{{ "lag"|term }}{% endblock %}"""


@pytest.fixture
def made(monkeypatch):
    """A function that renders a page with some content."""
    page._environment.cache_clear()  # one made before reads as ordinary
    source = page._source
    monkeypatch.setattr(page, "_source", lambda name: TEMPLATE if name == "t" else source(name))
    yield lambda **content: page.render("t", content)
    page._environment.cache_clear()


def test_a_page_has_its_charts_picks_styles_and_terms(made):
    picks = {"7": page.packed(Pick(title="Seed 7", charts=[chart("inside", "imm")]))}
    html = made(charts=[chart("One & Two")], picks=picks)
    data = page_data(html)
    (view,) = charts_of(html)["one-two"]
    ((line,),) = lines(view, "ekf")
    assert line["y"] == pytest.approx([0, 2], abs=0.01)  # a straight line
    assert "Seed 7" in data["picks"]["7"] and "pick-0" in charts_of(data["picks"]["7"])
    assert set(data["everyone"]) == {"ekf", "a&b"}
    assert set(data["terms"]) == {"lag"}
    for who in ("ekf", "a&b"):
        assert f'id="mark-{css_class(who)}"' in html and f".{css_class(who)} {{ --c:" in html


def test_text_of_a_chart_is_escaped(made):
    html = made(charts=[chart("<b>", "</svg><script>")])
    assert "</svg><script>" not in html.partition("<script type")[0] and "<b>" not in html


def test_two_charts_of_one_name_are_refused(made):
    with pytest.raises(ChartError, match="two charts of a page are named 'same'"):
        made(charts=[chart("Same"), chart("same")])


def test_an_unknown_term_is_refused():
    with pytest.raises(ChartError, match="no term 'lagg' in the glossary"):
        page.term("lagg")


def test_the_policy_names_the_script_that_is_there():
    import hashlib

    html = page.render("reporting/charts_old/templates/page.html", {})
    code = html.partition("<script>")[2].rpartition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    assert f"script-src &#39;sha256-{digest}&#39;" in html
    assert "</script" not in page.source().lower()
