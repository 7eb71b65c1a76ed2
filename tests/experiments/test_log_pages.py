"""Pages of logs: what they say first, and that no spike of a long log is lost on its chart."""

import numpy as np

from flexaxis.experiments.logs.changes import Change
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.pages.import_page import _finding as of_import
from flexaxis.experiments.logs.pages.track_page import track_page
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.reporting.charts_old.shapes import COLUMNS, extremes

N = 200_000


def spiked(n=N):
    """Noise with a single spike, and a gap."""
    y = np.random.default_rng(3).normal(size=n)
    y[n // 3], y[n // 2 : n // 2 + n // 50] = 50.0, np.nan
    return y


def test_no_spike_and_no_gap_is_lost():
    x, y = np.arange(1.0, N + 1), spiked()
    kept = extremes(x, y)
    assert len(kept) < 4 * COLUMNS and np.all(np.diff(kept) > 0)
    assert np.nanmax(y[kept]) == 50 and np.nanmin(y[kept]) == np.nanmin(y)
    gap = np.flatnonzero(np.isnan(y))
    assert set(kept) & set(gap) and kept[0] == 0 and kept[-1] == N - 1
    # In each column of the screen what is kept reaches as far as all samples there.
    wide = (x[-1] - x[0]) / COLUMNS
    column = np.minimum((x - x[0]) / wide, COLUMNS - 1).astype(int)
    for one in np.unique(column)[::97]:
        here = np.flatnonzero(column == one)
        if np.isfinite(y[here]).any():
            assert np.nanmax(y[here]) == np.nanmax(y[np.intersect1d(here, kept)])


def doubt(name, verdict):
    return Finding(verdict, "text", name, 1.0)


def test_an_import_says_first_what_spoils_it():
    bad, known, fine = doubt("units", "problem"), doubt("gaps", "note"), doubt("rate", "ok")
    words = "As it is, this log spoils estimates: units."
    assert of_import([bad, known, fine]) == Finding("problem", words)
    said = of_import([known, fine])
    assert said.kind == "note" and said.text.endswith("to be known: gaps.")
    words = "Nothing speaks against this log, in 1 looks at it."
    assert of_import([fine]) == Finding("ok", words)


def tracked(changes=(), doubts=()):
    time = 0.005 * np.arange(4000)
    theta = np.where(time < 8, 1.0, 1.5)[:, None]
    return Tracked(
        names=("f_m",), time=time, theta=theta, deviations=0.1 * theta, nominal=np.ones(1),
        usable=time > 1, fit=97.0, residual=np.random.default_rng(0).normal(size=4000),
        correlation=0.01, white=True, alarms=np.array([8.2]), changes=list(changes),
        doubts=list(doubts), load=None,
    )  # fmt: skip


def test_a_tracked_log_says_first_what_changed():
    changed = tracked([Change("f_m", 8.0, 0.5, 40.0)])
    told = {"estimator": "ekf", "log": "a.csv", "command": "flexaxis track a.csv"}
    page = track_page(changed, 0.005, problems=[], **told)
    assert page.finding == Finding(
        "note", "f_m changed by +50.0 % at 8.00 s (40 times its scatter)."
    )
    estimates = page.charts[0]
    assert estimates.marks == [(8.0, "f_m +50.0 %"), (8.2, "alarm")]
    line, nominal = estimates.panels[0].lines
    assert line.who == "ekf" and nominal.role == "bound"
    np.testing.assert_allclose(line.high - line.y, 0.2 * line.y)  # ±2σ
    quiet = track_page(tracked(), 0.005, problems=["clipping: much"], **told)
    kind, text = quiet.finding.kind, quiet.finding.text
    assert kind == "problem" and text.startswith("No parameter changed; last over nominal: f_m 1.5")
    assert "no change within this log, but f_m is 50 % above what was identified" in text
    assert quiet.remarks[0] == Finding("problem", "the log: clipping: much")
