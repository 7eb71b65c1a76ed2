"""Pages of logs: the answer first, and no spike of a long log is lost on its figure."""

import numpy as np

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.pages import MOST, import_page
from flexaxis.sim.record import Record

N = 200_000


def test_a_page_of_a_long_log_is_small_says_what_is_wrong_and_has_its_spike(tmp_path):
    speed = np.random.default_rng(3).normal(size=N)
    speed[N // 3] = 50.0
    valid = np.arange(N) % 50_000 > 100
    record = Record(time=1e-3 * np.arange(N), torque=np.sin(0.01 * np.arange(N)), speed=speed,
                    valid=valid)  # fmt: skip
    checks = (
        Finding("ok", "none", "units"),
        Finding("problem", "turned <", "signs", "-x"),
    )
    page = import_page(Imported(record, checks), "a.csv")
    assert page.finding.kind == "problem" and "signs" in page.finding.text
    page.write(tmp_path / "log.html")
    html = (tmp_path / "log.html").read_text(encoding="utf-8")
    assert len(html) < 400_000 and html.count("<svg") == 1
    assert "✗" in html and "turned &lt;" in html and "Import of a.csv" in html
    (line,) = page.charts[0].panels["speed [rad/s]"]
    assert line.y.max() == 50.0 and len(line.x) <= MOST
