"""A short scenario, so that a whole run takes a second."""

import signal
import sys
from pathlib import Path

import pytest

from flexaxis.experiments.catalogue.find import find_scenario

# what several tests share: logs and tables here, exact axes in `acceptance`
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "estimators")]

# a shell makes what it runs in the background deaf to Ctrl-C, of which some tests are
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

SHORT = {
    "name": "short",
    "duration": 8.0,
    "burn_in": 1.0,
    "fault": [{"kind": "step", "parameter": "f_m", "at": 6.0, "factor": 1.5}],
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Tests neither fill nor read the user's cache of records."""
    monkeypatch.setenv("FLEXAXIS_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="session")
def short():
    """f_m +50 % at 6 of 8 s."""
    return find_scenario("fm_step-v1").override(SHORT)


@pytest.fixture
def short_toml(short, tmp_path):
    """The same as a file."""
    path = tmp_path / "short.toml"
    path.write_text(short.to_toml(), encoding="utf-8")
    return path


@pytest.fixture
def stubs(monkeypatch):
    """The stand-ins for workers, importable here and in processes of a pool."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import study_stubs

    return study_stubs


@pytest.fixture
def stored():
    """A function that writes rows to a folder as a run or a study does, and gives `Results`."""
    from flexaxis.experiments.results.results import Results
    from flexaxis.experiments.scoring.score_table import undefined
    from flexaxis.experiments.storage.store import Store

    def write(folder, rows, axes=(), **study):
        folder.mkdir(exist_ok=True)
        each = {
            "case": "0", "hash": "h", "scenario": "s", "estimator": "e", "seed": 0,
            **undefined(), "parameter": "f_m", "changed": True, "diverged": False,
            "never_settled": False, "cost": {"us_per_sample": 1.0},
            "base": "s", "method": "e", "axes": {}, "seconds": 20.0, "rows": 1, "error": None,
        }  # fmt: skip
        known = {row["case"]: 0 for row in rows}
        for row in rows:
            known[row["case"]] += 1
        lines = [each | row | {"rows": known[row["case"]]} for row in rows]
        for line in lines:
            line["case"] = f"{int.from_bytes(line['case'].encode()):016x}"
            line.setdefault("code", line["case"])  # by which cases that are alike are told apart
        with Store(folder / "scores.sqlite", axes) as store:
            store.add(lines)
        return Results(folder, {"axes": list(axes), "estimators": [], "scenarios": []} | study)

    return write
