"""identify where its user knows the dry friction, or a part of it."""

import json

import pytest
from identify_axes import VALUES, log

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis

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
