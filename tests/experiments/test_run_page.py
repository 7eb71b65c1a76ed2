"""The report of a run: one ranking, the time at the fault, single runs that can be repeated."""

import re
import shlex
import shutil

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.reporting.run import first as run_first
from flexaxis.experiments.reporting.run import measures, over_time, singles, speed
from flexaxis.experiments.reporting.run import page as run_page
from flexaxis.experiments.reporting.tables import TERMS
from flexaxis.experiments.results import pooled
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.scoring.intervals import LEAST
from flexaxis.experiments.storage.traces import Traces
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark
from tests.experiments.kept_rows import change, scores_of
from tests.experiments.page_data import charts_of, lines, page_data, table, text_of

ESTIMATORS = ("frozen", "rpem-forgetting", "glr")


@pytest.fixture(scope="module")
def folder(short, tmp_path_factory):
    """A run of three estimators, two of them swept."""
    place = tmp_path_factory.mktemp("run") / "out"
    study = Study("t", (short,), ESTIMATORS, tuple(range(1000, 1006)))
    swept = {"swept_scenarios": [short], "swept_estimators": list(ESTIMATORS[1:])}
    benchmark(Benchmark(study, title="t", command="flexaxis run short.toml", **swept), place)
    return place


@pytest.fixture(scope="module")
def html(folder):
    return run_page.render(pooled.load(folder))


@pytest.fixture(scope="module")
def data(html):
    return page_data(html)


def test_it_is_read_from_top_to_bottom(html):
    texts = [
        "<h1>t</h1>", "flexaxis run short.toml", "At the fault: short</h2>", run_first.FASTEST,
        run_first.DISTANCE, "At equal noise</h2>", "Speed against noise</h2>",
        "How often, how near to the bound: nominal</h2>", '<h2 id="short">',
        "Parameters that did not change", "The same as a table", "What the columns mean",
        'href="scores.sqlite"', "Recursive identification of physical parameters",
    ]  # fmt: skip
    places = [html.index(text) for text in texts]
    assert places == sorted(places)


def test_there_is_one_ranking(html, folder):
    overall = [r["estimator"] for r in pooled.load(folder).summary["tradeoff"]["overall"]]
    assert overall[0] == "glr"
    for name in ("at-equal-noise", "short", "short-unchanged"):
        rows = [row["estimator"][0] for row in table(html, name)[1]]
        assert list(dict.fromkeys(rows))[:2] == overall, name


def test_the_first_table_is_saved_whole(html, folder):
    """What a file of it says besides a lag: of what, between what, and whether it is a limit."""
    first = html[html.index('data-name="at-equal-noise"') :].partition("</table>")[0]
    assert re.search(r'data-name="short [^"<>]*f_m[^"<>]* lag \[s\]"', first)
    matched = [
        r for r in pooled.load(folder).summary["tradeoff"]["matched"] if r["lag"] is not None
    ]
    assert matched
    for row in matched:
        low, high = ("never" if end is None else end for end in row["lag_interval"])
        assert f'data-value="{row["lag"]}" data-low="{low}" data-high="{high}"' in first
    marks = set(re.findall('data-mark="([^"]*)"', first))
    assert "★" in marks and marks <= {"★", "≤", "≥", "★ ≤", "★ ≥"}


def test_a_lag_in_brackets_is_saved_with_them(folder, monkeypatch):
    monkeypatch.setattr(run_page.mismatch, "mismatched", lambda _: ["short"])
    wrong = {("short", "f_m", "rpem-forgetting")}
    monkeypatch.setattr(run_page.mismatch, "misled", lambda *_, **__: wrong)
    html = run_page.render(pooled.load(folder))
    (matrix,) = re.findall(
        'data-name="unknown structure">.*?</table>|data-name="known structure">.*?</table>',
        html,
        re.DOTALL,
    )
    assert len(re.findall(r'data-mark="\(\)">\([\d.]+ s\)', matrix)) == 1
    assert html.count('data-mark="()"') == 2  # and in the table of its scenario


def test_cells_say_what_was_pooled(html, folder):
    heads, rows = table(html, "short")
    assert heads[2:10] == [
        "lag [s]", "× bound", "t10 [s]", "std [%]", "bias [%]", "score", "lost",
        "false alarms / 1000 s",
    ]  # fmt: skip
    pooled_rows = pooled.load(folder).summary["rows"]
    for row in rows:
        (own,) = [r for r in pooled_rows if r["changed"] and r["estimator"] == row["estimator"][0]]
        assert float(row["lag [s]"][0]) == pytest.approx(own["lag"], rel=1e-5)
        assert float(row["× bound"][0]) == pytest.approx(own["lag"] / own["lag_bound"], rel=1e-5)
        assert row["lost"] == ("0", "0 of 6")
    still = rows[-1]
    assert still["estimator"][0] == "frozen" and still["std [%]"] == ("0.0", "0")
    assert still["t10 [s]"][1] == "never"


def test_rounding_is_nothing_and_what_never_moves_has_no_interval():
    known = measures.measures()
    row = {
        "changed": True, "std": 3e-14, "std_interval": [1e-14, 5e-14], "bias": -2e-13,
        "lag": 5.0, "lag_interval": [5.0, 5.0], "t10": None, "t10_interval": [None, None],
    }  # fmt: skip
    cells = {name: known[name].of(row) for name in ("std", "bias", "lag", "t10")}
    assert [(c.text, c.within) for c in cells.values()] == [
        ("0", ""), ("0", ""), ("5", ""), ("never", ""),
    ]  # fmt: skip
    assert known["std"].of({"std": 1e-3, "std_interval": [9e-4, 2e-3]}).within == "0.0009 … 0.002"


def test_a_word_has_one_definition():
    columns = measures.glossary()
    both = [name for name in columns if name in TERMS]
    assert len(both) > 12 and all(columns[name] == TERMS[name] for name in both)
    assert "bootstrap" not in TERMS["interval"] and "Student" in TERMS["interval"]


def panel_of(view, label):
    (panel,) = [each for each in view["panels"] if each["y"] == label]
    return panel


def test_the_fault_is_drawn_beside_the_whole_run(html, folder):
    near, whole = charts_of(html)["curves-short"]
    assert [near["window"], whole["window"]] == ["at the fault", "whole run"]
    assert (near["from"], near["to"]) == pytest.approx((5.9, 7.0))
    assert near["panels"][0]["y"] == "f_m / nominal"  # it changes
    (curve,) = [c for c in pooled.load(folder).curves if c.estimator == "glr"]
    for i, parameter in enumerate(curve.names):
        panel = panel_of(near, f"{parameter} / nominal")
        (line,) = [each for each in panel["lines"] if each["who"] == "glr"]
        known = np.interp(curve.near.time, line["x"], line["y"])
        off = known - np.clip(curve.near.median[:, i], panel["low"], panel["high"])
        point = (panel["high"] - panel["low"]) / 165  # of a panel of so many points
        assert np.percentile(abs(off), 99) < point
        (truth,) = [each for each in panel["lines"] if each["role"] == "truth"]
        if parameter == "f_m":
            assert np.interp([5.95, 6.05], truth["x"], truth["y"]) == pytest.approx(
                [1, 1.5], abs=0.002
            )


def test_the_first_picture_is_of_the_parameter_that_changes(html):
    (view,) = charts_of(html)["at-a-fault"]
    assert [panel["y"] for panel in view["panels"]] == ["f_m / nominal"]
    assert (view["from"], view["to"]) == pytest.approx((5.0, 8.0))  # of 8 s, 5 s after the fault
    whom = {line["who"] for line in view["panels"][0]["lines"]}
    assert whom == {"", "glr", "rpem-forgetting"}  # frozen is a control


def test_whom_the_words_refuse_to_rank_no_chart_ranks(folder, monkeypatch):
    """An estimate with a large bias may meet the new value because it was wrong before."""
    wrong = {("short", "f_m", "glr")}
    monkeypatch.setattr(run_page.mismatch, "misled", lambda *_, **__: wrong)
    html = run_page.render(pooled.load(folder))
    found = charts_of(html)
    for name in ("ecdf-nominal", "runs-short", "at-a-fault"):
        whom = {line["who"] for panel in found[name][0]["panels"] for line in panel["lines"]}
        assert "glr" not in whom and "rpem-forgetting" in whom, name
    assert text_of(html).count("Not drawn, for the bias before the fault is more than half") == 2
    rows = pooled.load(folder).summary["rows"]
    chart = speed.as_set(rows, ESTIMATORS, wrong)
    assert {line.who for line in chart.panels[0].lines} == {"rpem-forgetting"}
    assert "glr (short)" in chart.words


def test_no_excitation_is_said_only_where_there_is_none(short):
    pause = find_scenario("pause_fm_step-v1")
    for scenario, said in ((short, False), (pause, True)):
        spans = [text for *_, text in over_time.around(scenario)["spans"]]
        assert ("no excitation" in spans) is said
        assert ("no excitation" in over_time._words(scenario)) is said


def test_each_run_can_be_opened(html, data):
    points = [line for p in charts_of(html)["runs-short"][0]["panels"] for line in p["lines"]]
    opened = {line["pick"] for line in points}
    # one that never moves has no spread, and so no point; it is in the table
    expected = {f"short/{e}/{seed}" for e in ESTIMATORS for seed in range(1000, 1006)}
    assert opened == {name for name in expected if "frozen" not in name}
    assert set(data["picks"]) == expected == set(re.findall(r'data-opens="([^"]*)"', html))
    panel = charts_of(html)["curves-short"][0]["panels"][0]
    medians = {line["pick"] for line in panel["lines"] if line["who"]}
    assert len(medians) == 3 and medians <= expected


def test_a_single_run_says_what_it_found(data, folder):
    run = data["picks"]["short/glr/1002"]
    assert re.search(r"Found: at 6\.\d\d s f_m × 1\.\d", text_of(run))
    assert "It reports no findings." in data["picks"]["short/frozen/1002"]
    near, whole = charts_of(run)["pick-0"]
    assert near["panels"][0]["y"] == "f_m / nominal"  # what changed comes first
    assert near["panels"][-1]["y"] == "residual, rms of 10 [rad/s]"
    assert "fm changes" in whole["text"] and "found: fm × 1." in near["text"]
    trace = Traces(folder).find(_hash(folder), "glr")[1002]
    ((line,), *_) = lines(near, "glr")
    shown = np.interp(6.5, line["x"], line["y"])
    assert shown == pytest.approx(trace.detail.near[120, 2], abs=5e-3)


def _hash(folder):
    return pooled.load(folder).summary["scenarios"]["short"]["hash"]


@pytest.mark.slow
def test_its_command_repeats_it_exactly(data, folder, short, tmp_path, monkeypatch):
    (tmp_path / "short.toml").write_text(short.to_toml(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    run = data["picks"]["short/rpem-forgetting/1003"]
    words = shlex.split(re.search('<pre class="command">(.*?)</pre>', run)[1])
    assert words[:3] == ["flexaxis", "run", "short.toml"]
    assert main(words[1:]) == 0

    def rows(place):
        return [
            row
            for row in scores_of(place).values()
            if (row["seed"], row["estimator"]) == (1003, "rpem-forgetting")
        ]

    again = rows(tmp_path / words[words.index("-o") + 1])
    assert len(again) == 3 and again == rows(folder)


def test_a_scenario_of_the_catalogue_is_named(short):
    Single, command = singles.Single, singles.command
    known = find_scenario("fm_step-v1")
    run = Single(known.name, "rpem-forgetting[forgetting=0.99]", 1000, [])
    assert command(run, known) == (
        "flexaxis run fm_step-v1 --estimator 'rpem-forgetting[forgetting=0.99]' "
        "--seeds 1000:1001 -o results/fm_step-v1-rpem-forgetting-forgetting-0.99-1000"
    )
    assert "fm_step-v1.toml" in command(run, known.override({"duration": 21.0}))


def test_an_own_estimator_is_repeated_where_its_path_holds(short):
    row = {"case": "c", "parameter": "f_m", "changed": False, "std": None, "diverged": False,
           "lag_bound": None}  # fmt: skip
    for text, told in (("own/mine.py:Mine", "own/mine.py"), ("/mine.py:Mine", ""), ("ekf", "")):
        facts = dict(singles.pick(singles.Single("short", text, 1, [row]), short, None).facts)
        assert (told in facts["folder"]) if told else ("folder" not in facts)


def test_a_small_report_has_fewer_single_runs_and_says_so(html, folder):
    bare = len(run_page.render(pooled.load(folder), size=0.0).encode())
    size = (bare + 0.4 * (len(html.encode()) - bare)) / 1e6
    small = run_page.render(pooled.load(folder), size=size)
    assert len(small.encode()) <= 1e6 * size
    kept = set(page_data(small)["picks"])
    assert 0 < len(kept) < 18
    assert f"{len(kept)} of 18 single runs can be opened" in small
    assert set(re.findall(r'data-opens="([^"]*)"', small)) == kept
    # the worst of the best comes first
    worst = max(_lags(folder, "glr").items(), key=lambda item: item[1])[0]
    assert f"short/glr/{worst}" in kept
    (line,) = re.findall(r"All of it: (flexaxis report [^<]*)</p>", small)
    assert main([*shlex.split(line)[1:], "-o", str(folder.parent / "all.html")]) == 0
    assert len(page_data((folder.parent / "all.html").read_text())["picks"]) == 18


def test_where_curves_alone_are_too_much_the_later_ones_are_left_out(folder, monkeypatch):
    monkeypatch.setattr(run_page, "AT_FIRST", 2)
    html = run_page.render(pooled.load(folder), size=0.05)
    whom = {n["who"] for p in charts_of(html)["curves-short"][0]["panels"] for n in p["lines"]}
    assert whom == {"", "glr", "rpem-forgetting"}
    assert "Only the first 2 of the ranking are drawn over time. 0 of 18 single runs" in html


def _lags(folder, estimator):
    rows = scores_of(folder).values()
    return {r["seed"]: r["lag"] for r in rows if r["changed"] and r["estimator"] == estimator}


def test_a_folder_without_trajectories_is_reported(folder, tmp_path):
    """As one that was converted from an older version."""
    found = pooled.load(folder)
    old = tmp_path / "old"
    shutil.copytree(folder, old)
    change(old, "DELETE FROM traces")
    bare = run_page.render(pooled.Pooled(found.summary, [], old))
    assert not charts_of(page_data(bare)["picks"]["short/glr/1002"])
    assert "curves-short" not in charts_of(bare)


def swept(*, seeds=6, **lags):
    """A sweep over one fault with a bound of .1 s; the first two lead, and the first finds it."""
    rows = [
        {"scenario": "s", "parameter": "f_m", "estimator": name, "how": "matched", "lag": lag,
         "over_bound": lag / 0.1, "leads": i < 2, "false_alarms_per_1000_s": None if i else 0.0,
         "values": {"lag": [0.0] * seeds}}
        for i, (name, lag) in enumerate(lags.items())
    ]  # fmt: skip
    overall = [{"estimator": name, "leads": not i} for i, name in enumerate(lags)]
    return {
        "tradeoff": {"matched": rows, "overall": overall, "points": [], "faults": {"s": "f_m"}},
        "estimators": {},
        "scenarios": {"s": {}, "other": {}},
    }


LAGS = {"mine": 0.2, "yours": 0.25, "rpem-forgetting": 1.0}


def test_three_questions_are_answered_from_the_table():
    fastest, distance, why = (answer for _, answer in run_first.answers(swept(**LAGS)))
    assert fastest.startswith("mine and yours: each ahead, or tied for it, in 1 of 1 fault; mine")
    assert "mine is tied with yours in 1 of 1" in fastest and "5 times shorter" in fastest
    assert distance == (
        "mine takes 2 times the lag of the bound; rpem-forgetting takes 10 times the lag of the "
        "bound."
    )
    assert "mine waits for evidence" in why
    assert run_first.answers({"tradeoff": None}) == []


def test_ties_of_who_leads_most_often_are_counted():
    summary = swept(**LAGS)
    rows = summary["tradeoff"]["matched"]
    rows += [row | {"scenario": "t", "leads": row["estimator"] == "mine"} for row in rows]
    (_, fastest), *_ = run_first.answers(summary)
    assert fastest.startswith(
        "mine: ahead, or tied for it, in 2 of 2 faults; mine is tied with yours in 1 of 2 ("
    )


def test_why_is_said_only_where_it_came_out():
    behind = swept(**{"rpem-forgetting": 0.2, "yours": 0.25, "mine": 1.0})
    assert run_first.WHY not in dict(run_first.answers(behind))  # the reference itself leads
    blind = swept(**LAGS)
    blind["tradeoff"]["matched"][0]["false_alarms_per_1000_s"] = None
    assert run_first.WHY not in dict(run_first.answers(blind))  # who leads waits for nothing


def test_too_few_seeds_rank_nobody():
    few, enough = swept(seeds=4, **LAGS), swept(seeds=5, **LAGS)
    ((_, answer),) = run_first.answers(few)
    assert answer == f"4 seeds are too few to rank: from {LEAST} on."
    for summary, stars in ((few, 0), (enough, 3)):
        equal = run_first.at_equal_noise(summary)
        ranked = [*equal["rows"].values(), *equal["overall"].values()]
        assert sum(row["leads"] for row in ranked) == stars
    assert run_first.at_equal_noise(few)["scope"] == (
        "Compared at equal noise: s. As set only, further down: other."
    )
    named, many = (few | {"scenarios": ["s", *"abcdefg"[:n]]} for n in (6, 7))
    assert run_first.at_equal_noise(named)["scope"].endswith(": a, b, c, d, e and f.")
    assert run_first.at_equal_noise(many)["scope"].endswith(" further down: 7 others.")


def test_columns_stand_under_the_noise_at_which_they_are_compared(html, folder):
    heads, rows = table(html, "at-equal-noise")
    assert "at equal std of the parameter that changes" in html
    assert "all faults, at equal excess error</span>" in html
    at_excess = pooled.load(folder).summary["tradeoff"]["at_excess"]
    for row in rows:
        (own,) = [r for r in at_excess if r["estimator"] == row["estimator"][0]]
        assert float(row["short: lag at equal excess error [s]"][0]) == own["lag"]
    assert heads[0] == "estimator"


def test_it_says_once_with_what_it_was_computed(html):
    (said,) = re.findall(r"Computed with ([^<]*)</p>", html)
    assert "scipy" in said and re.search(r"code [0-9a-f]{12}", said) and " on " in said


def test_settings_of_a_scenario_that_was_only_swept_are_made_by_tradeoff():
    study = {"tradeoff": {"estimators": ["rpem-drift", "my own.py:Mine"]}, "seeds": [1000, 1001]}
    assert run_page._sweep_of("fm_double-v1", study) == (
        "flexaxis tradeoff fm_double-v1 --estimator rpem-drift --estimator 'my own.py:Mine' "
        "--seeds 1000:1002"
    )


def test_more_than_nine_estimators_are_there_and_hidden_at_first(folder):
    names = [f"e{i}" for i in range(12)]
    found = pooled.load(folder)
    summary = found.summary | {"estimators": found.summary["estimators"] | dict.fromkeys(names, "")}
    html = run_page.render(pooled.Pooled(summary, found.curves, folder))
    assert run_page.Run.of(pooled.Pooled(summary, found.curves, folder)).order[9:] == names[6:]
    assert "Charts draw 9 of 15 estimators at first, the best of the first table" in html


def test_without_a_ranking_the_quickest_are_drawn_first():
    lags = {"slow": 2.0, "lost": 0.1, "quick": 0.2, "unasked": None}
    rows = [
        {"estimator": name, "changed": True, "lag": lag, "diverged": int(name == "lost")}
        for name, lag in lags.items()
    ]
    summary = {"estimators": dict.fromkeys(lags, ""), "rows": rows}
    names, words = run_first.drawn_first(summary, 2)
    assert names == ["quick", "slow", "lost", "unasked"]
    assert "draw 2 of 4" in words and "shortest lags as set" in words
    assert run_first.drawn_first(summary, 4) == (list(lags), "")
