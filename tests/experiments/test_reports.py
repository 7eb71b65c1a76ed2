"""Reports: what they say is computed, figures hold what they are given, pages stand alone."""

import re
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from flexaxis.experiments.comparison.ranking import faults_of
from flexaxis.experiments.reporting import figures, page, sentences, study, styles, terminal
from flexaxis.experiments.reporting.figures import Series

SEEDS = 8
STEP = {"parameter": "f_m", "kind": "step", "at": 10.0, "factor": 2.0}


def matched(estimator, lag, fault="s1", *, leads=False, how="matched"):
    values = [float(np.log(lag or 1.0))] * SEEDS
    return {
        "scenario": fault, "parameter": "f_m", "estimator": estimator, "lag": lag, "how": how,
        "lag_interval": lag and [0.9 * lag, 1.1 * lag], "bound": 0.04, "leads": leads,
        "over_bound": lag and lag / 0.04, "std_after": 0.4, "false_alarms_per_1000_s": None,
        "values": {"lag": values if lag else None},
    }  # fmt: skip


def summary(rows, **more):
    names = list(dict.fromkeys(row["estimator"] for row in rows))
    definition = {"name": "s1", "fault": [STEP]}
    overall = [{"estimator": name, "score": 90.0 - i, "score_interval": [80, 95], "leads": i == 0,
                "how": "matched"} for i, name in enumerate(names)]  # fmt: skip
    swept = {"matched": rows, "overall": overall, "points": [],
             "definitions": {name: definition for name in ("s1", "s2")}}  # fmt: skip
    return {
        "title": "test",
        "seeds": list(range(SEEDS)),
        "estimators": dict.fromkeys(names, "e"),
        "tradeoff": swept,
        "rows": [],
        "scenarios": {"s1": {"definition": definition}},
    } | more


def pooled(estimator, *, bias=0.1, diverged=0, scenario="s1"):
    return {"scenario": scenario, "parameter": "f_m", "estimator": estimator, "changed": True,
            "lag": 0.1, "bias": bias, "std": 1.0, "diverged": diverged, "seeds": SEEDS,
            "lag_bound": 0.04}  # fmt: skip


THREE = [matched("glr", 0.05, leads=True), matched("ekf", 0.5), matched("rpem-forgetting", 1.0),
         matched("glr", 0.1, "s2", leads=True), matched("ekf", 0.5, "s2"),
         matched("rpem-forgetting", 1.2, "s2")]  # fmt: skip


def every(rows, **change):
    return [row | change for row in rows]


@pytest.mark.parametrize(
    ("rows", "title"),
    [
        (THREE, "glr tracks a fault 12 to 20 times faster than rpem-forgetting, at equal noise"),
        (THREE[:1], "The lag of glr is 1.2 times the Cramér–Rao bound"),
        (every(THREE, leads=True), "The estimators do not differ significantly over 8 seeds"),
        (every(THREE, leads=False), "The estimators do not differ significantly over 8 seeds"),
        (every(THREE, lag=None), "Every run of every estimator diverged"),
        ([], "test: no estimators were compared at equal noise"),
        ([matched("ekf", 0.5), matched("rpem-forgetting", 0.2, leads=True)],
         "rpem-forgetting leads for 1 of 1 faults, at equal noise"),
        (THREE[:2], "glr leads for 1 of 1 faults, at equal noise"),
        (every(THREE, how="noisier"), "glr leads for 2 of 2 faults, at equal noise"),
        (every(THREE, values={"lag": [0.0, 0.1]}),
         "test: 2 seeds are too few for a ranking; 5 are needed"),
    ],
)  # fmt: skip
def test_the_title_is_the_answer(rows, title):
    assert sentences.answer(summary(rows))[0] == title


def swept(estimator, factor, lag):
    return {"scenario": "s1", "parameter": "f_m", "estimator": estimator, "factor": factor,
            "setting": f"{estimator}[{factor}]", "lag": lag, "std": factor, "diverged": 0,
            "lag_interval": [0.9 * lag, 1.1 * lag], "lag_bound": 0.04,
            "lag_bound_single": None}  # fmt: skip


ROW = {"metric": "lag", "parameter": "f_m", "scenario": "s1", "verdict": "worse", "change": 0.5,
       "interval": [0.2, 0.9], "margin": 0.02, "scale": None, "base": 0.1, "candidate": 0.15,
       "text": ["s1", "lag f_m", "0.1", "0.15", "+50 %", "+20 … +90 %", "worse"]}  # fmt: skip
VERDICT = {"headline": "WORSE: lag", "verdict": "worse", "advice": ["Look."], "base": "a<b>",
           "candidate": "b", "seeds": [1, 2], "rows": [ROW],
           "columns": list("abcdefg"), "legend": ["l"], "command": "",
           "worst": {"scenario": "s1", "seed": 3, "command": "flexaxis run"}}  # fmt: skip


def ids(html):
    return re.findall(r' id="([^"]+)"', html)


def test_the_script_is_short_and_asks_for_nothing():
    script = page.TEMPLATES.loader.get_source(page.TEMPLATES, "reporting/templates/page.js")[0]
    assert len(script.splitlines()) <= 150
    assert not re.search(r"fetch|XMLHttp|import\(|eval\(|innerHTML", script)


def test_what_must_not_be_missed():
    dry = {"definition": {"name": "dry", "fault": [STEP], "friction": {"coulomb": 0.1}}}
    rows = [pooled(name, scenario="dry", bias=bias)
            for name, bias in (("a", 34.0), ("b", -49.0), ("c", 40.0), ("glr", 0.0))]  # fmt: skip
    plain = [pooled("a"), pooled("glr")]
    scenarios = {"dry": dry, "s1": {"definition": {"fault": [STEP]}}}
    text, place = sentences.warning(plain + rows, scenarios)
    assert place == "dry" and text.startswith("With dry friction that the model lacks")
    assert "every estimator except glr are biased by 34–49 %" in text
    assert sentences.warning(plain, scenarios) is None


def test_nothing_to_draw_is_no_error():
    none = pd.DataFrame({"estimator": ["frozen"], "lag": [5.0], "std": [0.0]})
    figures.lag_against_noise(none).canvas.draw()


def test_speed_against_noise_is_measured_by_the_reference():
    rows = [swept("rpem-forgetting", f, 1 / f) for f in (0.5, 1.0, 2.0)] + [swept("ekf", 1.0, 3.0)]
    (ax,) = figures.speed_noise(faults_of(rows), {"s1: f_m": "w"}).axes
    line = {n.get_label(): n for n in ax.lines}
    curve = line["rpem-forgetting"].get_xydata()
    np.testing.assert_allclose(curve, [[0.5, 2], [1, 1], [2, 0.5]])
    assert line["ekf"].get_color() == styles.style("ekf").light
    assert ax.get_ylabel() == "w\nlag [s]" and set(line["bound"].get_ydata()) == {0.04}


def test_over_bound_has_a_dot_a_fault_and_its_interval():
    rows = faults_of(THREE)
    faults = {"s1: f_m": "one", "s2: f_m": "two"}
    ax = figures.over_bound(rows, ["glr", "ekf", "rpem-forgetting"], faults).axes[0]
    dots = sorted(n.get_xdata()[0] for n in ax.lines if len(n.get_xdata()) == 1 and n.get_gid())
    np.testing.assert_allclose(dots, np.sort(rows["over_bound"]))
    spans = [c.get_segments()[0][:, 0] for c in ax.collections]
    assert np.allclose(spans[0], [0.9 * 1.25, 1.1 * 1.25])


def test_a_comparison_draws_ratios_with_their_intervals():
    ax = figures.verdict_intervals(VERDICT["rows"]).axes[0]
    (dot,) = [n for n in ax.lines if n.get_marker() == "o"]
    assert dot.get_xdata()[0] == pytest.approx(1.5)
    margin, interval = (c.get_segments()[0][:, 0] for c in ax.collections)
    np.testing.assert_allclose([*margin, *interval], [1 / 1.02, 1.02, 1.2, 1.9])


def run(estimator, seed, lag, *, scenario="s", bound=0.5, diverged=False):
    return {"scenario": scenario, "parameter": "f_m", "seed": seed, "estimator": estimator,
            "lag": lag, "lag_bound": bound, "over_bound": bound and lag and lag / bound,
            "diverged": diverged}  # fmt: skip


def test_shares_are_what_one_counts_by_hand():
    rows = [  # on s: a at 2, 1 and 4 × bound, b lost, then at 10; on t: a at 2 ×, b has no lag
        run("a", 0, 1.0), run("a", 1, 0.5), run("a", 2, 2.0), run("b", 0, 0.5, diverged=True),
        run("b", 1, 5.0), run("a", 0, 0.2, scenario="t", bound=0.1),
        run("b", 0, None, scenario="t", bound=0.1), run("a", 0, 1.0, scenario="u", bound=None),
    ]  # fmt: skip
    for order in (rows, rows[::-1]):
        ax = figures.shares(pd.DataFrame(order)).axes[0]
        found = {n.get_label(): n.get_xydata() for n in ax.lines}
        np.testing.assert_allclose(found["a"], [[1, 0.25], [2, 0.5], [2, 0.75], [4, 1]])
        np.testing.assert_allclose(found["b"], [[10, 0.25]])


def test_the_page_of_a_comparison_stands_alone():
    html = page.comparison(VERDICT)
    assert html.index("WORSE: lag") < html.index("<svg role") < html.index("<table")
    assert "a&lt;b&gt;" in html and "a<b>" not in html
    assert len(ids(html)) == len(set(ids(html)))
    assert not re.findall(r'(?:src|href)="(?!#)', html)
    assert "http:" not in re.sub("xmlns[^>]*", "", html) and "https:" not in html
    named = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', html)
    assert {a or b for a, b in named} <= {*ids(html), "content"}


def test_a_figure_of_a_page_has_classes_titles_and_variables():
    name = '<b>$x_1$ & "y"[a=1]'
    series = [Series(x=[0, 1.2345, 2], y=[0, 1, 2], estimator=name, kind="both")]
    looks = styles.assigned([name])
    html = page.drawn(figures.curves, "f", {"y": series}, x="x", looks=looks)
    root = ElementTree.fromstring(html.replace("xlink:", ""))  # well-formed
    text = ElementTree.tostring(root, encoding="unicode")
    assert f'class="est-{page.slug(name)}"' in text and ": 1 at 1.2</" in text
    assert f"var(--style-{looks[name].place})" in text and looks[name].light.lower() not in text
    assert page.slug("a[b=1]") != page.slug("a[b=-1]")
    assert not re.search(r'[ "]-?\d+\.\d{3,}[ "]', html)
    assert html == page.drawn(figures.curves, "f", {"y": series}, x="x", looks=looks)


def test_the_terminal_says_who_leads():
    shown = terminal.as_text(terminal.equal_noise_table(summary(THREE)["tradeoff"]))
    assert "motor friction +100 %: lag [s]" in shown and "recommended" in shown
    lines = [line.split() for line in shown.splitlines()]
    assert ["glr", "★", "0.050", "★", "0.10", "★", "90"] in lines
    few = every(THREE, values={"lag": [0.0, 0.1]})
    shown = terminal.as_text(terminal.equal_noise_table(summary(few)["tradeoff"]))
    assert "2 seeds are too few" in shown and "★ 0.050" not in shown


@pytest.mark.slow
def test_a_study_answers_first_and_has_a_map_of_two_axes(stored, tmp_path):
    size, friction = "fault[0].factor", "friction.coulomb"
    rows = [
        {"case": f"{who}{x}{y}{seed}", "estimator": who, "method": who, "seed": seed,
         "hash": f"{x}{y}", "axes": {size: x, friction: y}, "lag": lag * x, "lag_bound": 0.1,
         "lag_null": 5.0, "std": 1.0, "score": 100 - 40 * lag}
        for who, lag in (("glr", 0.5), ("ekf", 2.0)) for x in (1.2, 2.0) for y in (0.01, 0.1)
        for seed in range(3)
    ]  # fmt: skip
    definition = {"name": "s", "duration": 20.0, "friction": {"coulomb": 0.1}, "fault": [STEP]}
    more = {"scenarios": [{"definition": definition}], "seeds": [0, 1, 2], "streams": "own"}
    html = study.render(stored(tmp_path, rows, [size, friction], **more))
    title = html[html.index("<h1>") + 4 : html.index("</h1>")]
    assert title.startswith("glr has the highest score over the fault factor (new / old value)")
    assert html.count('aria-label="glr: lag [s] over') == 1
    assert "0.60</text>" in html and "4.0</text>" in html  # cells of glr and of ekf
