"""A short scenario, so that a whole run takes a second."""

import json
import signal
import sys
from concurrent.futures import Future
from pathlib import Path

import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import RecordCache, records

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


@pytest.fixture(scope="session")
def record_cache(tmp_path_factory):
    """Return the folder with the records of the short scenario, seeds 1000 to 1007."""
    folder = tmp_path_factory.mktemp("records")
    records(find_scenario("fm_step-v1").override(SHORT), range(1000, 1008), RecordCache(folder))
    return folder


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Tests neither fill nor read the user's cache of records."""
    monkeypatch.setenv("FLEXAXIS_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def recorded(record_cache, monkeypatch):
    """Take the records of the short scenario from a cache that tests share."""
    monkeypatch.setenv("FLEXAXIS_CACHE", str(record_cache))


class InProcess:
    """A worker without a process: to start one takes seconds."""

    def submit(self, work, *args):
        """Return a future that is done."""
        future = Future()
        try:
            future.set_result(work(*args))
        except Exception as error:
            future.set_exception(error)
        return future

    def end(self):
        """Do nothing: what it is given is done at once."""


@pytest.fixture(autouse=True)
def no_workers(request, monkeypatch):
    """Fast tests run cases in their own process."""
    if "slow" not in request.keywords:
        monkeypatch.setattr("flexaxis.experiments.running.runner.Worker", InProcess)


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
def stored():
    """A function that writes rows to a folder as a run or a study does, and gives `Results`."""
    from flexaxis.experiments.running.case import Done, numbers_of
    from flexaxis.experiments.running.results import Results
    from flexaxis.experiments.running.store import Store
    from flexaxis.experiments.scoring.score_table import undefined

    def write(folder, rows, axes=(), **study):
        each = {
            "case": "0", "hash": "h", "scenario": "s", "estimator": "e", "seed": 0,
            **undefined(), "parameter": "f_m", "changed": True, "diverged": False,
            "never_settled": False, "cost": {"us_per_sample": 1.0},
            "base": "s", "method": "e", "axes": {}, "seconds": 20.0, "error": None,
        }  # fmt: skip
        cases = {}
        for row in rows:
            cases.setdefault(row["case"], []).append(each | row)
        store = Store(folder)
        content = {"name": "s", "axes": list(axes), "estimators": [], "scenarios": []} | study
        store.tell(study=content)
        for case, lines in cases.items():
            first = lines[0]
            about = {
                "scenario": first["base"], "estimator": first["method"], "code": None,
                "setting": first["estimator"], "hash": first["hash"], "axes": first["axes"],
                "changes": first["axes"],
                "seconds": first["seconds"], "parameters": [line["parameter"] for line in lines],
            }  # fmt: skip
            numbers = numbers_of(lines)
            named = first["isolation"] and json.dumps(first["isolation"])
            store.add([Done(case, json.dumps(about), first["seed"], numbers, named,
                            first["error"])])  # fmt: skip
        return Results(store, content)

    return write
