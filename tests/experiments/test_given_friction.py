"""identify where its user knows the dry friction, or a part of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identify_axes import VALUES, log

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identify import free_names
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of
from flexaxis.sim.record import load_record

F_C = 10 * VALUES[1]["f_m"]


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("given") / "rec.nc"
    return log(1, 10, "moves", seed=0, seconds=8.0).save(path)


def identify(record, *more):
    words = ["identify", record, "--model", "one_mass", "-o", record.with_name("axis.toml")]
    return main([*map(str, words), *more])


@pytest.mark.parametrize(
    "more",
    [(), pytest.param(("--friction", "coulomb"), marks=pytest.mark.slow)],
    ids=["auto", "coulomb"],
)
def test_a_level_that_is_given_stays(record, capsys, more):
    identify(record, "--fix", f"f_c={F_C}", "--json", *more)
    told = json.loads(capsys.readouterr().out)
    assert "f_c" not in told["estimates"]
    assert told["estimates"]["f_m"]["value"] == pytest.approx(VALUES[1]["f_m"], rel=0.05)
    axis = find_axis(str(record.with_name("axis.toml")))
    assert axis.model.nominal["f_c"] == F_C and axis.model.laws


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--fix", "f_c=0.05", "--friction", "none"), "--friction none has no f_c"),
        (("--fix", "v_s=0.05", "--friction", "coulomb"), "coulomb has no v_s"),
        (("--fix", "f_cc=0.05"), "Did you mean 'f_c'?"),
        (("--start", "jm=0.05"), "Did you mean 'J_m'?"),
    ],
)
def test_what_no_law_has_is_refused_before_all_else(record, capsys, more, said):
    assert identify(record, *more) == 2
    assert said.casefold() in capsys.readouterr().err.casefold()


def test_what_a_known_axis_has_at_zero_stays_there_unless_freed():
    known = replace(find_axis("two_mass").having({"f_l": 0.0}), known=True)
    assert "f_l" not in free_names(known, (), ()) and "f_m" in free_names(known, (), ())
    assert free_names(known, ("f_l", "k"), ()) == ("f_l", "k")
    assert "f_l" in free_names(replace(known, known=False), (), ())


@pytest.mark.filterwarnings("error")
def test_a_start_that_cannot_be_simulated_is_the_worst(record):
    """A resonance that is far too fast for the rate of the log."""
    setup = Setup(
        log_of(load_record(record), find_axis("two_mass")),
        find_axis("two_mass").model, ("J_m", "k"), delay=0.0, highpass=None,
    )  # fmt: skip
    assert setup.solve(np.array([1e-9, 1e4])).square == np.inf
