"""Rows on the disk: none lost, none doubled, none torn, whatever ends the process."""

import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from flexaxis.experiments.building import processes
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.storage.files import NotRun, StudyError
from flexaxis.experiments.storage.store import Store
from flexaxis.experiments.studies.definition import study_from
from tests.experiments.kept_rows import cases_of, change, lines_of, scores_of

HERE = Path(__file__).parent
STUDY = {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen", "ekf"], "twins": False,
         "sweep": {"fault[0].factor": [1.5, 2.0]}}  # fmt: skip


def study(seeds):
    return study_from(STUDY | {"seeds": seeds})


def complete(folder, cases):
    """Whether every case is there with all its rows, once."""
    found = {}
    for row in scores_of(folder).values():
        found.setdefault(row["case"], []).append(row["parameter"])
    assert all(sorted(names) == ["1/J_a", "f_m", "k_T"] for names in found.values())
    return len(found) == cases


def test_a_unit_is_there_whole_or_not_at_all(stubs, tmp_path, monkeypatch):
    """Whichever of its rows cannot be written, and whatever is raised there."""
    run_study(study(2), tmp_path, means=Means(work=stubs.quick))
    before = scores_of(tmp_path)

    class Killed(BaseException):
        pass

    for place in range(12):
        left = iter(range(place))

        def broken(self, row, left=left, usual=Store._stored):
            if next(left, None) is None:
                raise Killed
            return usual(self, row)

        with monkeypatch.context() as patch:
            patch.setattr(Store, "_stored", broken)
            with pytest.raises(Killed):
                run_study(study(40), tmp_path, means=Means(work=stubs.quick))
        assert scores_of(tmp_path) == before
    run_study(study(40), tmp_path, means=Means(work=stubs.quick))
    assert complete(tmp_path, 160)


def test_what_is_missing_in_the_middle_is_run_and_nothing_else(stubs, tmp_path):
    run_study(study(20), tmp_path, means=Means(work=stubs.quick))
    change(tmp_path, "DELETE FROM cells WHERE (rowid - 1) / 3 IN (3, 9)")
    assert run_study(study(20), tmp_path, means=Means(work=stubs.quick)).cases == 2
    assert complete(tmp_path, 80)


@pytest.mark.slow
def test_two_processes_may_work_in_one_folder(stubs, tmp_path):
    """Each does what it found missing; every row is there once."""
    code = PROGRAM.format(here=str(HERE), study=STUDY, seeds=200, folder=str(tmp_path))
    both = [subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
            for _ in range(2)]  # fmt: skip
    told = [process.communicate(timeout=300)[1] for process in both]
    assert [process.returncode for process in both] == [0, 0], told
    assert complete(tmp_path, 800)


def test_shares_have_files_of_their_own(stubs, tmp_path):
    seen = []

    def meanwhile(unit):
        if not seen:
            seen.append(unit)
            run_study(make_plan(study(4), shard=(2, 2)), tmp_path, means=Means(work=stubs.quick))
        return stubs.quick(unit)

    run_study(make_plan(study(4), shard=(1, 2)), tmp_path, means=Means(work=meanwhile))
    assert {p.name for p in tmp_path.glob("s*.sqlite")} == {
        "scores-1-of-2.sqlite", "scores-2-of-2.sqlite"
    }  # fmt: skip
    assert seen and complete(tmp_path, 16)


def test_a_disk_that_is_full_loses_nothing(stubs, tmp_path):
    """A limit on the size of files stands in for the disk: the write is cut short just so."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (75_000, before[1]))
    try:
        with pytest.raises(NotRun, match=r"scores\.sqlite: cannot be written"):
            run_study(study(200), tmp_path, means=Means(work=stubs.quick))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    there = cases_of(tmp_path)
    assert 0 < there < 800 and complete(tmp_path, there)
    assert run_study(study(200), tmp_path, means=Means(work=stubs.quick)).cases == 800 - there
    assert complete(tmp_path, 800)


class Pool:
    """A pool that breaks as one of processes does: for what was handed out, and for good."""

    def __init__(self, dies):
        self.dies, self.broken = dies, False

    def submit(self, work, unit):
        if self.broken:
            raise BrokenProcessPool("a process was killed")
        future = Future()
        self.broken = self.dies(unit)
        if self.broken:
            future.set_exception(BrokenProcessPool("a process was killed"))
        else:
            future.set_result(work(unit))
        return future

    def shutdown(self, **how):
        """End nothing."""


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_pool_that_breaks_is_replaced_and_nothing_is_lost(stubs, tmp_path, monkeypatch, deaths):
    """Two units kill their process, so often; what was out with them is run again, once."""
    killed, pools = [], []

    def dies(unit):
        due = unit.seeds[0] in (1004, 1010) and killed.count(unit.seeds[0]) < deaths
        killed.extend([unit.seeds[0]] * due)
        return due

    def started(jobs, begin):
        pools.append(jobs)
        return Pool(dies), threading.Event()

    monkeypatch.setattr(processes, "_started", started)
    run_study(study(20), tmp_path, means=Means(jobs=2, work=stubs.quick))
    assert complete(tmp_path, 80)
    assert len(killed) == deaths * 2 and {1, 2} == set(pools)


def test_a_unit_that_fails_elsewhere_is_named(stubs, tmp_path):
    from concurrent.futures import ThreadPoolExecutor

    with (
        ThreadPoolExecutor(1) as executor,
        pytest.raises(StudyError, match=r"given up on fm_step-v1.*OSError: the network"),
    ):
        run_study(study(1), tmp_path, Means(executor=executor, work=stubs.fails))


def test_only_so_many_units_are_out_at_a_time(stubs, tmp_path):
    from concurrent.futures import Executor, Future

    class Counting(Executor):
        out, most = 0, 0

        def submit(self, work, unit):
            self.out += 1
            self.most = max(self.most, self.out)
            future = Future()
            future.set_result(work(unit))
            future.result = lambda inner=future: self._give(inner)
            return future

        def _give(self, future):
            self.out -= 1
            return Future.result(future)

    executor = Counting()
    run_study(study(100), tmp_path, Means(executor=executor, in_flight=5, work=stubs.quick))
    assert executor.most == 5 and complete(tmp_path, 400)


def test_a_case_that_fails_is_a_row_and_the_study_goes_on(short_toml, capsys, tmp_path):
    (tmp_path / "own.py").write_text(
        "class Odd:\n"
        "    names, output = ('f_m',), 'speed'\n"
        "    def __init__(self, nominal, period): self.seen = 0.0\n"
        "    def step(self, u, y):\n"
        "        self.seen += abs(y or 0.0)\n"
        "        if self.seen > 1e3: raise ZeroDivisionError('no luck')\n"
        "        return [0.05]\n"
    )
    (tmp_path / "s.toml").write_text(
        f"scenario = '{short_toml}'\nestimators = ['frozen', '{tmp_path}/own.py:Odd']\nseeds = 1\n"
        "[sweep]\ncontroller.Kv = [0.22, 50.0]\n"  # the second loop is unstable
    )
    words = ["study", str(tmp_path / "s.toml"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    words += ["--run-code"]
    assert main(words) == 70  # code crashed
    assert "3 cases could not be run" in capsys.readouterr().err
    errors = {}
    for row in lines_of(tmp_path / "out"):
        errors.setdefault((row["controller.Kv"], row["method"][-3:]), row["error"])
    assert errors[0.22, "zen"] is None
    assert "ZeroDivisionError: no luck" in errors[0.22, "Odd"]
    assert errors[50.0, "zen"].startswith("SimulationError")
    assert main([*words, "--resume"]) == 70  # it is a result: not run again, and still told
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "3 cases could not be run" in page


# ---------------------------------------------------------------- kills

PROGRAM = """
import sys
sys.path.insert(0, {here!r})
import study_stubs
from pathlib import Path
from flexaxis.experiments.building import processes
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.studies.definition import study_from
run_study(study_from({study!r} | {{"seeds": {seeds}}}), Path({folder!r}),
          means=Means(work=study_stubs.slowly))
"""


@pytest.mark.slow
def test_twenty_kills_of_the_command_with_its_processes(short_toml, tmp_path):
    """The real thing: simulations in two processes, killed twenty times at random moments."""
    (tmp_path / "s.toml").write_text(
        f"scenario = '{short_toml}'\nestimators = ['frozen', 'rpem-forgetting']\nseeds = 150\n"
        "[sweep]\n'fault[0].factor' = [1.1, 1.5, 2.0, 3.0]\n"
    )
    words = [sys.executable, "-m", "flexaxis.experiments", "study", str(tmp_path / "s.toml")]
    words += ["-o", str(tmp_path / "out"), "--resume", "--jobs", "2"]
    chance, killed = random.Random(0), 0
    path = tmp_path / "out" / "scores.sqlite"
    seen = [60_000]
    while killed < 20:
        child = subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                 start_new_session=True)  # fmt: skip
        while child.poll() is None and not (path.exists() and path.stat().st_size > seen[-1]):
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 0.5))
        child.send_signal(signal.SIGKILL)
        if child.wait() != -signal.SIGKILL:
            break
        killed += 1
        assert gone(child.pid), "processes are left after a kill"
        seen.append(path.stat().st_size)
    subprocess.run(words, check=True, capture_output=True)
    assert complete(tmp_path / "out", 1500)  # with the twins without a fault
    assert killed == 20


def gone(session, patience=10.0):
    """Whether all processes of a session end: workers must not outlive a killed parent."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        alive = subprocess.run(["ps", "-o", "pid=,stat=", "-s", str(session)],
                               capture_output=True, text=True, check=False).stdout  # fmt: skip
        if not [line for line in alive.splitlines() if not line.split()[1].startswith("Z")]:
            return True
        time.sleep(0.1)
    return False


MEMORY = (
    PROGRAM.replace("study_stubs.slowly", "study_stubs.quick")
    + """
import resource
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_study(tmp_path):
    """Twenty thousand cases may take 10 MB more than two thousand; their rows are 60 MB."""
    used = []
    for seeds in (500, 5000):
        code = MEMORY.format(
            here=str(HERE), study=STUDY, seeds=seeds, folder=str(tmp_path / str(seeds))
        )
        for _ in range(2):  # run, and go through the rows that are there
            out = subprocess.run(
                [sys.executable, "-c", code], capture_output=True, text=True, check=True
            )
            used.append(int(out.stdout) / 1024)
        assert complete(tmp_path / str(seeds), 4 * seeds)
    assert (tmp_path / "5000" / "scores.sqlite").stat().st_size > 6e6
    assert max(used[2:]) - max(used[:2]) < 10, used


@pytest.mark.slow
def test_a_disk_that_is_really_full(short_toml, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=128k", "none", str(disk)],
                             capture_output=True, check=False)  # fmt: skip
    if mounted.returncode:
        pytest.skip("no right to mount a small file system")
    try:
        (tmp_path / "s.toml").write_text(
            f"scenario = '{short_toml}'\nestimators = ['frozen']\nseeds = 200\n"
            "[sweep]\n'fault[0].factor' = [1.5]\n"  # with an axis there are rows and nothing else
        )
        words = [sys.executable, "-m", "flexaxis.experiments", "study", str(tmp_path / "s.toml")]
        words += ["-o", str(disk / "out"), "--jobs", "1"]
        child = subprocess.run(words, capture_output=True, text=True, check=False)
        assert child.returncode == 70
        assert "scores.sqlite: cannot be written: No space left on the disk" in child.stderr
        assert "cases done just now; go on with: flexaxis study" in child.stderr
        assert "Traceback" not in child.stderr
        there = cases_of(disk / "out")
        assert there > 20 and complete(disk / "out", there)
        subprocess.run(["mount", "-o", "remount,size=8m", str(disk)], check=True)
        subprocess.run([*words, "--resume"], check=True, capture_output=True)
        assert complete(disk / "out", 400)  # with the twins without a fault
    finally:
        subprocess.run(["umount", str(disk)], check=False)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # distributed warns of the worker that is killed here
def test_a_worker_of_dask_is_killed(short, tmp_path):
    """Two workers, one of them killed: all rows, and those of a local run."""
    distributed = pytest.importorskip("distributed", reason="the extra `cluster`")

    (tmp_path / "short.toml").write_text(short.to_toml(), encoding="utf-8")
    wanted = study_from(
        {"name": "s", "scenario": str(tmp_path / "short.toml"), "seeds": 40,
         "estimators": ["frozen", "rpem-forgetting"], "sweep": {"fault[0].factor": [1.5, 2.0]}}
    )  # fmt: skip
    landed = []
    two = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**two) as cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())

        def advance(outcome):
            landed.append(outcome)
            if len(landed) == 2:
                os.kill(pids[0], signal.SIGKILL)

        means = Means(executor=client.get_executor(), in_flight=4, advance=advance)
        run_study(wanted, tmp_path / "dask", means)
    run_study(wanted, tmp_path / "local")
    found = [sorted(map(_row, (tmp_path / name / "scores.sqlite").read_text().splitlines()))
             for name in ("dask", "local")]  # fmt: skip
    assert complete(tmp_path / "dask", 160) and found[0] == found[1]


def _row(line):
    return json.dumps({k: v for k, v in json.loads(line).items() if k != "cost"})
