"""A page with everything that the kit of pages has, small enough to know every value in it."""

import numpy as np

from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.charts import Chart, Line, Panel, Pick

HOSTILE = '<img src=x onerror=alert(1)>"&|=#'
WHO = ("rpem-forgetting", "rpem-drift", "ekf", "glr", HOSTILE)
GROUPS = ("step", "step", "ramp", "step", "ramp")
LAGS = (0.9, 0.5, float("inf"), 0.0625, None)
TIME = np.linspace(0, 20, 401)

TEMPLATE = """{% extends "reporting/templates/page.html" %}
{% block title %}: sample{% endblock %}
{% block kind %} class="wide"{% endblock %}
{% block body %}
<h1>Sample</h1>
<p>How soon is {{ "lag"|term }}? See <a href="#estimates">estimates</a>.</p>
<pre class="command">flexaxis run smoke --seeds 8</pre>
<h2>Scores of {{ "f_m"|symbols }}</h2>
<div class="scroll"><table class="numbers live" id="scores" data-name="scores">
<tr><th>estimator</th><th>group</th><th data-term="lag">lag [s]</th><th data-more>seeds</th></tr>
{% for who, group, lag in rows %}
<tr data-who="{{ who }}" data-group="{{ group }}"><td>{{ who|look }}{{ who }}</td>
<td class="text">{{ group }}</td>
<td data-value="{{ "" if lag is none else lag }}">{{ lag|number }}</td><td>8</td></tr>
{% endfor %}
</table></div>
<h3>Wide</h3>
<div class="scroll"><table class="numbers live" id="wide" data-name="wide">
<tr><th>row</th>{% for i in range(20) %}<th>column {{ i }} [s]</th>{% endfor %}</tr>
{% for n in range(7) %}
<tr><td>row {{ "abcdefg"[n] }}</td>
{% for i in range(20) %}<td>{{ (n * i / 7)|number }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% for chart in charts %}
<h2>{{ chart.title }}</h2>
{{ chart|drawn }}
<p class="muted">{{ chart.words }}</p>
{% endfor %}
<details><summary>Definition</summary><p>hidden words</p></details>
<h2>Marked</h2>
<div class="scroll"><table class="numbers live" id="marked" data-name="marked">
<tr><th>row</th><th data-name="step f_m lag [s]"><a href="#estimates">step</a><br>lag [s]</th>
<th>score</th><th>change</th><th data-more="again">twice</th></tr>
<tr><td>a</td><td data-value="0.16593" data-low="0.12" data-high="never" data-mark="★ ≥">★ ≥ 0.166
<span class="ci">2 × bound<br>0.12 … never</span></td>
<td data-value="-3">−3 <span class="ci">-54 … 21.5</span></td>
<td>+21 … +103 %</td><td>1</td></tr>
<tr><td>=1+1</td><td data-value="">–</td><td data-value="7">7</td><td>-2+cmd|x</td><td>2</td></tr>
</table></div>
<details><summary>Single runs</summary><table class="numbers live" data-name="runs">
<tr><th>run</th></tr>
<tr><td><button type="button" data-opens="1003">1003</button></td></tr></table></details>
<section data-group="ramp"><h2 id="a-ramp">A ramp</h2><p>words</p></section>
<section data-group="step"><h2 id="a-step">A step</h2><p>words</p></section>
{% endblock %}
"""


def render(monkeypatch, changed=None):
    """Return the page; `changed` is done to its code, to see what a test says to a dead feature."""
    ordinary = page._source
    monkeypatch.setattr(
        page, "_source", lambda name: TEMPLATE if name == "sample.html" else ordinary(name)
    )
    if changed is not None:
        whole = page.source
        monkeypatch.setattr(page, "source", lambda: whole(changed))
    page._environment.cache_clear()  # one made before reads as ordinary
    return page.render("sample.html", content())


def content():
    return {
        "rows": list(zip(WHO, GROUPS, LAGS, strict=True)),
        "charts": [estimates(), tradeoff()],
        "picks": {"1003": page.packed(picked())},
    }


def curve(n, parameter):
    return 1 + 0.1 * parameter + 0.4 * (TIME > 10) * (1 - np.exp(-(TIME - 10) / (0.3 * (n + 1))))


def estimates():
    panels = []
    for p, name in enumerate(("k_T", "f_m")):
        lines = [
            Line(who=who, x=TIME, y=(y := curve(n, p)), low=y - 0.03, high=y + 0.03, pick="1003")
            for n, who in enumerate(WHO)
        ]
        truth = Line(
            x=np.array([0.0, 10.0, 20.0]),
            y=np.array([1.0, 1.4, 1.4]) + 0.1 * p,
            kind="steps",
            label="truth",
            role="truth",
        )
        panels.append(Panel(y=f"{name} / nominal", lines=[*lines, truth]))
    return Chart(
        title="Estimates",
        words="Median and 10–90 % of the runs.",
        x="time [s]",
        panels=panels,
        marks=[(10.0, "f_m × 1.4")],
        spans=[(0.0, 2.0, "burn-in")],
        windows=[("at the fault", 9.9, 11.0), ("whole run", 0.0, 20.0)],
        name="estimates",
    )


def tradeoff():
    knob = np.geomspace(0.03, 1, 6)
    lines = [
        Line(
            who=who,
            x=knob * (n + 1),
            y=1 / knob / (n + 1) ** 2,
            low=0.8 / knob / (n + 1) ** 2,
            high=1.3 / knob / (n + 1) ** 2,
            kind="both",
        )
        for n, who in enumerate(WHO)
    ]
    bound = Line(x=knob, y=0.05 / knob, label="bound, all unknown", role="bound")
    known = Line(x=knob, y=0.03 / knob, label="bound, others known", role="bound")
    panel = Panel(y="lag [s]", lines=[*lines, bound, known], y_log=True)
    return Chart(
        title="Speed against variance",
        words="Nearer to the corner is better.",
        x="std of f_m [%]",
        panels=[panel],
        x_log=True,
    )


def picked():
    line = Line(who="ekf", x=TIME, y=curve(2, 0))
    chart = Chart(
        title="Seed 1003", words="", x="time [s]", panels=[Panel(y="f_m / nominal", lines=[line])]
    )
    return Pick(
        title="Seed 1003 of fm_step-v1",
        facts=[("finding", "f_m × 1.42 at 10.3 s")],
        command="flexaxis track fm_step-v1 --seed 1003",
        charts=[chart],
    )
