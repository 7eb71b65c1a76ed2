"""Tables in terminals of some width: nothing is cut, and what has no room is named."""

import io
import os

import pytest
from rich.console import Console

from flexaxis.experiments.cli import main
from flexaxis.experiments.reporting import terminal
from flexaxis.experiments.scoring.intervals import LEAST
from flexaxis.experiments.scoring.score_table import SCORES

NAMES = ["rpem-forgetting", "pipe:/home/somebody/of/us/a_very_long_name_of_a_program --x"]


def rows():
    """Two estimators on a fault; every score has a value as wide as values are."""
    values = {score.name: 123.4 for score in SCORES.values()} | {"lag_interval": [1.0, 1.2]}
    values |= {"scenario": "fm_step-v1", "parameter": "1/J_a", "changed": True, "lag": 12.34}
    values |= {"recovered": None}  # but of scenarios whose controller follows the estimates
    values |= {"diverged": 12, "never_settled": 12, "cost": {"us_per_sample": 123.4}}
    return [values | {"estimator": name} for name in NAMES]


@pytest.mark.parametrize(("width", "columns"), [(40, 4), (60, 7), (80, 10), (200, 11)])
def test_the_table_of_scores(monkeypatch, width, columns):
    monkeypatch.setattr(terminal, "_width", lambda: width)
    table, out = terminal.score_table(rows()), io.StringIO()
    Console(file=out, width=width).print(table)
    text = out.getvalue()
    assert "…" not in text and max(map(len, text.splitlines())) <= width
    assert len(table.columns) == columns
    assert "".join(NAMES[1].split())[-8:] in "".join(text.split())
    assert table.columns[-1 if width == 40 else 6].header == "lost"
    assert ("x-talk: largest" in " ".join(text.split())) == (columns >= 10)
    assert "lost: diverged runs" in " ".join(text.split())
    assert ("left out, for the terminal is narrow: " in text) == (columns < 11)


def test_a_lag_that_nobody_ranks_stands_in_brackets():
    wrong = {("fm_step-v1", "1/J_a", NAMES[0])}
    (_, *lags) = terminal.score_table(rows(), wrong).columns[2].cells
    assert [lag[0] == "(" for lag in lags] == [True, False]


def test_what_tracking_buys_has_a_column_where_it_is_defined():
    table = terminal.score_table([row | {"recovered": 97.0} for row in rows()])
    assert "recov %" in [column.header for column in table.columns]


STRANGE = "[red]x\x1b]0;title\x07\x1b[2J\u202e"
SHOWN = r"[red]x\x1b]0;title\x07\x1b[2J\u202e"


@pytest.mark.parametrize("key", ["estimator", "parameter", "scenario"])
def test_a_name_drives_no_terminal(key):
    """One in somebody else's rows, which `report` and `compare` show."""
    out, (row, _) = io.StringIO(), rows()
    Console(file=out, width=250).print(terminal.score_table([row | {key: STRANGE}]))
    assert SHOWN in out.getvalue()
    assert all(c.isprintable() or c == "\n" for c in out.getvalue())


@pytest.mark.parametrize("key", ["estimator", "parameter", "scenario"])
def test_nor_does_one_at_equal_noise(key):
    names = {"scenario": "fm_step-v1", "parameter": "f_m", "estimator": "ekf"}
    values = {"lag": 1.0, "lag_interval": [0.9, 1.1], "over_bound": 2.0, "std_after": 1.0}
    values |= {"values": {"lag": [0.0] * LEAST}}
    row = names | values | {"false_alarms_per_1000_s": 0.0, "leads": True, "how": ""}
    out, table = io.StringIO(), terminal.equal_noise_table([row | {key: STRANGE}], [])
    Console(file=out, width=250).print(table)
    assert SHOWN in out.getvalue()
    assert all(c.isprintable() or c == "\n" for c in out.getvalue())


@pytest.mark.parametrize("seeds", [LEAST - 1, LEAST])
def test_who_leads_is_marked_or_that_there_are_too_few_seeds(seeds):
    """Also in a result of before, whose rows said that somebody leads."""
    names = {"scenario": "fm_step-v1", "parameter": "f_m", "estimator": "ekf", "how": "matched"}
    row = names | {"lag": 1.0, "lag_interval": None, "over_bound": 2.0, "std_after": 1.0}
    row |= {"false_alarms_per_1000_s": 0.0, "leads": True, "values": {"lag": [0.0] * seeds}}
    total = {"estimator": "ekf", "how": "", "score": 80.0, "score_interval": None, "leads": True}
    out, table = io.StringIO(), terminal.equal_noise_table([row], [total])
    Console(file=out, width=250).print(table)
    assert out.getvalue().count("* ekf") == 2 * (seeds == LEAST)
    assert ("*: the best" in out.getvalue()) == (seeds == LEAST)
    few = f"{seeds} seeds are too few to rank: from {LEAST} on"
    assert (few in out.getvalue()) == (seeds < LEAST)


@pytest.mark.skipif(os.name == "nt", reason="there are no such terminals")
def test_no_colour_is_asked_for(monkeypatch):
    """NO_COLOR leaves bold letters, as https://no-color.org has it."""
    monkeypatch.setenv("NO_COLOR", "1")
    lost = [row | {"diverged": True} for row in rows()]
    out = io.StringIO()
    Console(file=out, width=200, force_terminal=True).print(terminal.score_table(lost))
    assert "\x1b[31m" not in out.getvalue() and "\x1b[1m" in out.getvalue()


def test_the_catalogue_in_a_narrow_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    assert main(["list"]) == 0
    text = capsys.readouterr().out
    assert "…" not in text and max(map(len, text.splitlines())) <= 40
    assert "coarse_encoder_coulomb_fm_step-v1" in text and "f_m +50 % at 10 s" in text
