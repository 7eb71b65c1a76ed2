"""Records kept between runs: the same bits, never stale, never trusted when damaged."""

import os
from importlib.resources import files

import numpy as np
import pytest

import flexaxis as fx
from flexaxis.experiments.running import cache
from flexaxis.experiments.running.cache import SIGNALS, RecordCache, records
from flexaxis.experiments.storage.files import sources
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.simulate import simulate

PRESENT = [*({*SIGNALS} - {"true_angle_l"}), "true_parameters"]
"""What a record of the paper's axis has."""


@pytest.fixture
def store(tmp_path):
    return RecordCache(tmp_path / "records")


def test_a_second_time_nothing_is_simulated(short, store):
    first, simulated = records(short, [5, 3], store)
    assert simulated == 2
    second, simulated = records(short, [3, 5, 4], store)
    assert simulated == 1
    assert [r.seed for r in second] == [3, 5, 4]
    for made, kept in zip(first, (second[1], second[0]), strict=True):
        for name in PRESENT:
            assert getattr(made, name).tobytes() == getattr(kept, name).tobytes()
        assert made.scenario == kept.scenario and made.versions == kept.versions


def test_models_are_among_the_sources():
    names = {
        file.name for part in ("models_mjcf", "sim") for file in sources(files(f"flexaxis.{part}"))
    }
    assert {"three_mass.xml", "simulate.py"} <= names


def test_another_content_is_another_entry(short, store, monkeypatch):
    records(short, [0], store)
    assert records(short.override({"noise.speed": 0.2}), [0], store)[1] == 1
    assert records(short.override({"name": "renamed"}), [0], store)[1] == 0
    monkeypatch.setattr(cache, "digest_of", lambda *parts: "another plant")
    assert records(short, [0], store)[1] == 1


@pytest.mark.parametrize(
    "changes",
    [{"start": 1.2}, {"identify": ["k_T", "f_m"]}, {"told": {"k_g": 1.1}}, {"output": "increment"},
     {"burn_in": 2.0}],
    ids=str,
)  # fmt: skip
def test_what_estimators_are_told_is_not_simulated_again(short, store, changes):
    """And the record given is that of the scenario that asks."""
    records(short, [0], store)
    asking = short.override(changes, inherit=True)
    (kept,), simulated = records(asking, [0], store)
    (made,) = simulate(asking, [0])
    assert simulated == 0
    for name in PRESENT:
        assert getattr(made, name).tobytes() == getattr(kept, name).tobytes()
    assert kept.hash == asking.hash == made.hash != short.hash
    assert (kept.scenario, kept.burn_in) == (asking.resolved(), asking.burn_in)
    # but a fault of another size is, with the same random numbers or not
    assert records(short.override({"fault[0].factor": 2.0}, inherit=True), [0], store)[1] == 1


@pytest.mark.parametrize("damage", ["cut", "flip", "foreign"])
def test_a_damaged_entry_is_rebuilt(short, store, damage):
    good = records(short, [0], store)[0][0]
    (entry,) = store.entries()
    whole = bytearray(entry.read_bytes())
    if damage == "flip":
        whole[len(whole) // 2] ^= 1
    entry.write_bytes({"cut": whole[:-1000], "flip": whole, "foreign": b"text"}[damage])
    again, simulated = records(short, [0], store)
    assert simulated == 1
    np.testing.assert_array_equal(again[0].speed, good.speed)
    assert records(short, [0], store)[1] == 0


def test_the_least_recently_used_go_first(short, store):
    records(short, [0, 1, 2], store)
    for age, seed in ((300, 1), (200, 0), (100, 2)):
        path = store._path(short, seed)
        os.utime(path, (path.stat().st_atime, path.stat().st_mtime - age))
    records(short, [1], store)  # used just now
    small = RecordCache(store.folder, limit=store.size() * 2 // 3)
    assert small.evict() == 1
    assert records(short, [1, 2], store)[1] == 0
    assert records(short, [0], store)[1] == 1


def test_a_full_folder_is_made_room_in_and_an_empty_one_is_not_looked_at(short, store, monkeypatch):
    looked = []
    evict = RecordCache.evict
    monkeypatch.setattr(RecordCache, "evict", lambda self: looked.append(1) or evict(self))
    records(short, [0], store)
    one = store.size()
    for seed in (1, 2, 3):
        records(short, [seed], store)
    assert len(looked) == 1  # the first time: who knows what others left
    small = RecordCache(store.folder, limit=round(2.5 * one))
    for seed in (4, 5):
        records(short, [seed], small)
        assert small.size() <= small.limit


def test_a_folder_that_cannot_be_written_stops_nobody(short, tmp_path):
    (tmp_path / "file").write_text("")
    assert records(short, [0], RecordCache(tmp_path / "file" / "records"))[1] == 1


def test_a_run_says_what_it_simulated(short_toml, tmp_path, capsys, monkeypatch):
    from flexaxis.experiments.cli import main

    monkeypatch.setenv("FLEXAXIS_CACHE", str(tmp_path / "records"))
    words = ["run", str(short_toml), "--seeds", "2", "--jobs", "1", "-o", str(tmp_path / "out")]
    main([*words, "--estimator", "frozen"])
    assert "2 records simulated" in capsys.readouterr().err
    main([*words, "--estimator", "rpem-drift"])
    assert "0 records simulated" in capsys.readouterr().err
    main([*words, "--estimator", "frozen", "--no-cache", "--overwrite"])
    assert "2 records simulated" in capsys.readouterr().err
    cleared = fx.cache(clear=True)
    # And the nominal run, where this process did not know it yet.
    assert cleared.removed in {2, 3} and cleared.records == 0
    monkeypatch.setenv("FLEXAXIS_CACHE_LIMIT", "lots")
    with pytest.raises(FlexaxisError, match="FLEXAXIS_CACHE_LIMIT"):
        fx.cache()


def test_scenarios_with_one_reference_share_its_nominal_run(short, store, monkeypatch):
    """Other words, another fault, another noise: the axis and its reference are the same."""
    from flexaxis.experiments.scoring import nominal

    nominal._torque.cache_clear()
    nominal.nominal_torque.cache_clear()
    alone = nominal.nominal_torque(short)
    nominal._torque.cache_clear()
    nominal.nominal_torque.cache_clear()
    counted = []
    monkeypatch.setattr(
        cache, "simulate", lambda *a, **k: counted.append(a[1]) or simulate(*a, **k)
    )
    others = [{"card": "other"}, {"fault[0].factor": 2.0}, {"noise.speed": 0.3}, {"start": 1.2}]
    with cache.kept_runs(store):
        for changes in ({}, *others):
            found = nominal.nominal_torque(short.override(changes, inherit=True))
            np.testing.assert_array_equal(found, alone)
        assert len(counted) == 1
        nominal._torque.cache_clear()  # as in another process
        nominal.nominal_torque.cache_clear()
        np.testing.assert_array_equal(nominal.nominal_torque(short), alone)
    assert len(counted) == 1
