"""One engine for runs and studies: what is shared, what is refused, and how it is stopped."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from flexaxis.experiments.building import away
from flexaxis.experiments.building import code as named
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.building.processes import Workers
from flexaxis.experiments.cli import main
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running import engine
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.running.merge import merge
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.verify import verify
from flexaxis.experiments.running.work import Outcome, run_unit
from flexaxis.experiments.storage import store
from flexaxis.experiments.storage.files import NotRun, OutputError, StudyError
from flexaxis.experiments.storage.schema import row_files
from flexaxis.experiments.storage.store import rows_in
from flexaxis.experiments.studies.definition import study_from
from tests.experiments.kept_rows import cases_of, lines_of, scores_of

OWN = """
class Mine:
    names, output = ("f_m",), "speed"
    def __init__(self, nominal, period, gain=GAIN): self.f_m = nominal["f_m"] * gain
    def step(self, u, y): return [self.f_m]
"""


def sweep_of(short_toml, **keys):
    content = {"name": "s", "scenario": str(short_toml), "estimators": ["frozen"], "seeds": 3,
               "twins": False}  # fmt: skip
    return study_from(content | keys)


def found(folder):
    return [row for path in row_files(folder) for row in rows_in(path)]


# ------------------------------------------------------------- records shared


def test_a_sweep_of_what_only_estimators_see_simulates_once(short_toml, tmp_path):
    study = sweep_of(short_toml, sweep={"start": [0.8, 1.0, 1.25], "identify": [["f_m"], ["J_a"]]})
    finished = run_study(study, tmp_path / "a")
    assert finished.cases == 18 and finished.simulated == 3
    other = sweep_of(short_toml, sweep={"fault[0].factor": [1.1, 1.5, 2.0]})
    assert run_study(other, tmp_path / "b").simulated == 9


@pytest.mark.parametrize(("streams", "shared"), [("common", True), ("own", False)])
def test_sizes_of_a_fault_share_what_is_random(short_toml, tmp_path, streams, shared):
    """Before the fault the two axes are one: what is said of it is the same number."""
    study = sweep_of(short_toml, sweep={"fault[0].factor": [1.2, 2.0]}, streams=streams,
                     estimators=["rpem-forgetting"])  # fmt: skip
    run_study(study, tmp_path)
    std = {}
    for row in found(tmp_path):
        std.setdefault((row["seed"], row["parameter"]), set()).add(row["std"])
    assert {len(values) for values in std.values()} == {1 if shared else 2}


# ----------------------------------------------------------- what is refused


def test_two_scenarios_of_one_name_are_refused(short):
    other = short.override({"name": short.name, "duration": 9.0})
    with pytest.raises(StudyError, match="two scenarios have the name 'short'"):
        Study("s", (short, other), ("frozen",), (0,))


def test_two_scenarios_that_differ_only_in_their_names_are_refused(short):
    with pytest.raises(StudyError, match="short and other are the same but for their names"):
        Study("s", (short, short.override({"name": "other"})), ("frozen",), (0,))


@pytest.mark.slow
def test_a_run_of_failures_alone_is_said(short_toml, tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        OWN.replace("GAIN", "1.0").replace("[self.f_m]", "[1 / (u - u)]")
    )
    words = ["run", str(short_toml), "--estimator", f"{tmp_path}/own.py:Mine", "--seeds", "1"]
    for more in ([], ["--shard", "1/1"], ["--json"], ["--shard", "1/2", "--json"]):
        out = tmp_path / str(len(more)) / "-".join(more).replace("/", "")
        assert main([*words, *more, "-o", str(out)]) == 70
        said = capsys.readouterr()
        assert "1 case could not be run" in said.err and "ZeroDivisionError" in said.err
        if "--json" in more:
            json.loads(said.out)
    assert main(["report", str(tmp_path / "0" / "")]) == 0
    assert "1 case could not be run" in capsys.readouterr().err


def resealed(path, old, new):
    """Make a study.json as if it had been written with another text in it."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_a_scenario_under_another_name_is_refused_and_verified_by_its_hash(short, tmp_path):
    study = Study("s", (short,), ("frozen",), (0,))
    run_study(study, tmp_path)
    renamed = Study("s", (short.override({"name": "other"}),), ("frozen",), (0, 1))
    with pytest.raises(StudyError, match="has the scenario other under the name short"):
        run_study(renamed, tmp_path)
    path = tmp_path / "study.json"
    resealed(path, '"short"', '"other"')
    told = [text for repeated in verify(tmp_path) for text in repeated.differences]
    assert told and all(": scenario was" in text or ": base was" in text for text in told)


def test_points_with_other_random_numbers_are_another_study(short_toml, tmp_path):
    keys = {"sweep": {"fault[0].factor": [1.2, 2.0]}, "seeds": 1}
    run_study(sweep_of(short_toml, streams="own", **keys), tmp_path)
    with pytest.raises(StudyError, match=r"with own streams, and this is .* with common streams"):
        run_study(sweep_of(short_toml, **keys), tmp_path)


def test_shares_that_overlap_count_once(stubs, tmp_path):
    study = study_from({"name": "s", "scenario": "fm_step-v1", "estimators": "frozen", "seeds": 8})
    means = Means(work=stubs.quick)
    for shard in ((1, 2), (2, 3), (2, 2)):
        run_study(make_plan(study, shard=shard), tmp_path, means)
    assert len(list(tmp_path.glob("scores-*.sqlite"))) == 3
    results = Results.load(tmp_path)
    keys = [(row["case"], row["parameter"]) for row in results.rows]
    assert len(keys) == len({*keys}) == 8 * 3 and results.cases == 8


def test_of_a_case_that_is_in_two_folders_the_first_one_stays(stubs, tmp_path):
    study = study_from({"name": "s", "scenario": "fm_step-v1", "estimators": "frozen", "seeds": 8})
    first, second = tmp_path / "first", tmp_path / "second"
    run_study(make_plan(study, shard=(1, 2)), first, Means(work=stubs.quick))
    run_study(make_plan(study), second, Means(work=stubs.costly))
    merge([first, second], tmp_path / "whole")
    costs = [line["cost.seconds"] for line in lines_of(tmp_path / "whole")]
    assert sorted(costs) == [0.1] * 12 + [9.0] * 12


def test_rows_of_code_that_changed_are_added_and_not_mixed(short_toml, tmp_path):
    own, out = tmp_path / "own.py", tmp_path / "out"
    study, lags, codes = sweep_of(short_toml, estimators=[f"{own}:Mine"]), [], []
    for gain in ("1.0", "2.0", "1.0"):
        own.write_text(OWN.replace("GAIN", gain))
        away._running.clear()  # as in another process: in one, what was imported goes on
        named._imported.clear()
        run_study(study, out, run_code=True)
        rows = list(Results.load(out).rows)
        lags.append([row["bias"] for row in rows])
        codes.append({row["code"] for row in rows})
        with Bench(study.scenarios, out) as bench:
            ((runs,),) = [[*bench.runs(study.scenarios, study.estimators, [1000]).values()]]
        assert [run[0]["code"] for run in runs] == [*codes[-1]]
    assert lags[0] == lags[2] != lags[1] and codes[0] == codes[2] != codes[1]
    assert all(re.fullmatch("[0-9a-f]{12}", code) for each in codes for code in each)
    assert len(found(out)) == 2 * 3  # each was run once
    (code,) = codes[0]
    shutil.copytree(out, tmp_path / "other")
    resealed(tmp_path / "other" / "study.json", code, "0" * 12)
    with pytest.raises(StudyError, match="with different code"):
        merge([out, tmp_path / "other"], tmp_path / "whole")


def test_versions_are_not_mixed(short_toml, tmp_path):
    study = sweep_of(short_toml)
    run_study(study, tmp_path)
    path = tmp_path / "study.json"
    resealed(path, "mujoco 4", "mujoco 3")
    with pytest.raises(StudyError, match=r"was made with .*mujoco 3.*this is .*mujoco 4"):
        run_study(study, tmp_path)


def test_a_merge_that_lacks_a_share_says_so(short_toml, tmp_path, capsys):
    study = sweep_of(short_toml, seeds=6)
    for share in (1, 2, 3):
        run_study(make_plan(study, shard=(share, 3)), tmp_path / str(share))
    parts = [str(tmp_path / str(share)) for share in (1, 2, 3)]
    assert main(["run", "--from", *parts[:2], "-o", str(tmp_path / "two")]) == 1
    said = capsys.readouterr()
    assert "2 of 6 cases are in no shard" in said.err and "4 cases" in said.out
    assert main(["run", "--from", *parts, "-o", str(tmp_path / "whole")]) == 0


def test_a_merge_adds_and_is_whole_or_not_at_all(short_toml, tmp_path, monkeypatch):
    study = sweep_of(short_toml, seeds=4)
    run_study(study, tmp_path / "a")
    with monkeypatch.context() as patch:
        patch.setattr(store, "_TAKE", (*store._TAKE, "SELECT * FROM nowhere"))
        with pytest.raises(OutputError, match="nowhere"):
            merge([tmp_path / "a"], tmp_path / "b")
    assert found(tmp_path / "b") == []
    assert merge([tmp_path / "a"], tmp_path / "b").cases == 4
    run_study(sweep_of(short_toml, seeds=5), tmp_path / "a")
    assert merge([tmp_path / "a"], tmp_path / "b").cases == 5
    assert found(tmp_path / "b") == found(tmp_path / "a")


# ------------------------------------------------------------------ the bench


def test_what_is_not_compiled_yet_is_so_before_all_wait_for_it(short, monkeypatch):
    plan = replace(make_plan(Study("one", (short,), ("frozen",), (0,))), uncompiled=["a", "b"])
    began = []

    def spread(tasks, work, **how):
        began.append((work.__name__ if hasattr(work, "__name__") else "run", list(tasks)))
        yield Outcome(cases=1)

    monkeypatch.setattr(engine, "spread", spread)
    for jobs, first in ((2, [("compile_for", ["a", "b"])]), (1, [])):
        list(Means(jobs=jobs).outcomes(plan))
        assert [began.pop(0) for _ in first] == first
        assert [name for name, _ in began] == ["run"]
        began.clear()


def test_a_bench_runs_nothing_twice_and_remembers(short, tmp_path):
    counted = []
    means = Means(advance=lambda outcome: counted.append(outcome.cases))
    with Bench([short], tmp_path, means) as bench:
        first = bench.runs([short], ["frozen"], [0, 1])
        bench.runs([short], ["frozen", "ekf"], [0, 1, 2])
    assert sum(counted) == 6
    with Bench([short], tmp_path, means) as bench:
        assert bench.runs([short], ["frozen"], [0, 1]) == first
    assert sum(counted) == 6
    with ThreadPoolExecutor(2) as executor:
        other = Bench([short], means=Means(executor=executor)).runs([short], ["frozen"], [0, 1])
    scores = [[[{k: v for k, v in row.items() if k != "cost"} for row in run] for run in runs]
              for given in (first, other) for runs in given.values()]  # fmt: skip
    assert scores[0] == scores[1]


def test_a_bench_does_not_write_to_a_folder_it_has_not_taken(short, tmp_path):
    with pytest.raises(ValueError, match="with Bench"):
        Bench([short], tmp_path).runs([short], ["frozen"], [0])


def test_a_bench_says_what_failed_after_the_others_ran(short, tmp_path):
    (tmp_path / "own.py").write_text(
        OWN.replace("GAIN", "1.0").replace("return [self.f_m]", "return [1 / (u - u)]")
    )
    own = f"{tmp_path}/own.py:Mine"
    with Bench([short], tmp_path / "out") as bench:
        with pytest.raises(EstimatorCrash, match=r"ZeroDivisionError: .* \(.*own\.py:5\)"):
            bench.runs([short], [own, "frozen"], [0])
        assert cases_of(tmp_path / "out") == 2
        with pytest.raises(StudyError, match="unknown estimator 'ekff'"):
            bench.runs([short], ["ekff"], [0])


# ----------------------------------------------------------------- stopping it

USUAL = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
COMMAND = USUAL + "from flexaxis.experiments.cli import main; sys.exit(main())"


def start(words, said):
    """Start a command as a terminal would: alone in its group, to which Ctrl-C goes."""
    with open(said, "w", encoding="utf-8") as stderr:
        return subprocess.Popen([sys.executable, "-c", COMMAND, *map(str, words)],
                                stderr=stderr, stdout=subprocess.DEVNULL,
                                start_new_session=True)  # fmt: skip


def wait_until(holds, patience, child=None):
    began = time.monotonic()
    while not holds():
        assert child is None or child.poll() is None, "it ended"
        assert time.monotonic() - began < patience
        time.sleep(0.01)


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_waits_for_what_is_at_work_and_twice_ends_at_once(short_toml, tmp_path, jobs):
    """To the whole group, as a terminal sends it. What is allowed is ten times what it takes."""
    words = ["run", short_toml, "--estimator", "rpem-drift", "--seeds", "4000", "--no-cache",
             "--jobs", jobs, "-o", tmp_path / "out"]  # fmt: skip
    path, said = tmp_path / "out" / "scores.sqlite", tmp_path / "said"
    for times in (1, 2):
        there = path.stat().st_size if path.exists() else 60_000
        child = start([*words, "--resume"], said)
        wait_until(lambda there=there: path.exists() and path.stat().st_size > there, 120, child)
        os.killpg(child.pid, signal.SIGINT)
        wait_until(lambda: "Ctrl-C again ends at once" in said.read_text(), 30)
        if times == 2:
            os.killpg(child.pid, signal.SIGINT)
        assert child.wait(timeout=120 if times == 1 else 30) == 130
        told = said.read_text()
        assert "Traceback" not in told, told
        line = r"interrupted; (\d+) cases? done just now; go on with: flexaxis run .*--resume"
        said_done = int(re.search(line, told)[1])
        assert times == 2 or said_done == cases_of(path.parent)
    assert len(scores_of(path.parent)) == 3 * cases_of(path.parent)


def test_a_pool_that_is_left_by_an_error_does_not_wait_for_its_processes():
    """They are killed, else this takes five minutes."""
    with pytest.raises(KeyboardInterrupt), Workers(1) as pool:
        future = pool.submit(time.sleep, 300)
        wait_until(future.running, 60)
        began = time.monotonic()
        raise KeyboardInterrupt
    assert time.monotonic() - began < 60


def test_what_was_cancelled_is_no_trouble_to_a_pool_that_is_killed(monkeypatch):
    """Under load its processes may be dead before it has heard that it is to end."""
    raised = []
    monkeypatch.setattr(threading, "excepthook", raised.append)
    with Workers(1) as workers:
        futures = [workers.submit(time.sleep, 300) for _ in range(5)]
        wait_until(futures[0].running, 60)
        assert futures[-1].cancel()
        pool, late = workers._pool, workers._pool.shutdown
        monkeypatch.setattr(pool, "shutdown", lambda **how: (time.sleep(1), late(**how)))
        workers.end(killed=True)
    assert not raised and futures[0].done()


def test_cases_that_are_missing_are_no_success(short, tmp_path):
    """Whatever has lost them: what is there is kept, and the others are said."""
    study = Study("s", (short,), ("frozen",), tuple(range(6)))

    def loses(unit):
        return Outcome() if 5 in unit.seeds else run_unit(unit)

    with pytest.raises(NotRun, match=r"[12] of 6 cases were not run: nothing says why"):
        run_study(study, tmp_path / "out", Means(work=loses))
    assert run_study(study, tmp_path / "out").cases in {1, 2}  # as units are cut
