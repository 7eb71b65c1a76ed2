"""Where core-seconds go: each is on one account, and none is lost."""

import json
from threading import Thread
from time import thread_time

import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.scoring import limits
from flexaxis.experiments.scoring.spending import OTHER, ledger, spent


def burn(seconds):
    start = thread_time()
    while thread_time() - start < seconds:
        pass


def test_what_is_inside_counts_once():
    with ledger() as outer:
        burn(0.02)
        with spent("a"):
            burn(0.02)
            with spent("b"):
                burn(0.04)
            with ledger() as inner, spent("a"):
                burn(0.03)
    assert {name: round(s, 2) for name, s in outer.items()} == {"a": 0.02, "b": 0.04, OTHER: 0.02}
    assert inner["a"] == pytest.approx(0.03, abs=0.005)


def test_what_other_threads_do_is_on_no_account_of_this_one():
    other = Thread(target=burn, args=[0.1])
    with ledger() as seconds, spent("a"):
        other.start()
        other.join()
    assert sum(seconds.values()) < 0.05


def test_without_a_ledger_nothing_is_kept():
    with spent("a"):
        burn(0.001)
    with ledger() as seconds:
        pass
    assert list(seconds) == [OTHER]


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_campaign_says_where_its_time_went(short_toml, capsys, tmp_path, monkeypatch, jobs):
    monkeypatch.chdir(tmp_path)
    limits._remembered.cache_clear()  # what another test has had computed takes no time here
    words = ["speed", "--campaign", str(short_toml), "--seeds", "2", "--jobs", str(jobs)]
    words += ["--estimator", "rpem-forgetting", "--estimator", "frozen"]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    seconds = told["core_seconds"]
    wanted = {"plant", "estimator rpem-forgetting", "estimator frozen", "scores", "bounds",
              "pooling scores", "the report", "record cache", "waiting"}  # fmt: skip
    assert wanted <= set(seconds) and min(seconds.values()) >= 0
    assert sum(seconds.values()) == pytest.approx(told["wall"] * jobs, rel=0.02)
    assert (told["cases"], told["records"], told["jobs"]) == (4, 2, jobs)
    needed = sum(s for name, s in seconds.items()
                 if name.startswith(("plant", "estimator", "compiling")))  # fmt: skip
    assert told["overhead"] == pytest.approx(
        1 - needed / (sum(seconds.values()) - seconds["waiting"])
    )
    assert list(tmp_path.iterdir()) == [short_toml]  # its results are thrown away


def test_options_of_a_campaign_need_one(capsys):
    assert main(["speed", "--seeds", "2"]) == 2
    assert "--campaign" in capsys.readouterr().err


def test_what_is_compiled_on_the_way_is_no_time_of_who_needs_it():
    import numba

    from flexaxis.experiments.running.compiling import COMPILING, compiled_apart

    @numba.njit
    def inner(x):
        return x + 1.0

    @numba.njit
    def outer(x):
        return inner(x) * 2.0

    with ledger() as seconds, compiled_apart(), spent("a"):
        outer(1.0)
        outer(2.0)
    assert seconds[COMPILING] > 5 * seconds["a"]
    with pytest.raises(numba.TypingError), ledger() as failed, compiled_apart():
        outer("text")
    assert set(failed) == {COMPILING, OTHER}
