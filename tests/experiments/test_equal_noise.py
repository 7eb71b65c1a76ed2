"""`compare --match-std`: cases with a known answer, what each side is told to be, and refusals."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.comparison.tune import TOLERANCE
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import PARAMETER_NAMES

sys.path.insert(0, str(Path(__file__).parent))
from page_data import text_of

SHORT = {"duration": 8.0, "fault[0].at": 6.0}
HELD_BACK = 120  # samples, .6 s


pytestmark = pytest.mark.usefixtures("recorded")


class Same:
    """The reference under another name, with 1 − λ for its knob, four times as quick."""

    names, output, knob, held = ("k_T", "1/J_a", "f_m"), "speed", "nu", 0

    def __init__(self, nominal, period, *, nu=0.02):
        model = three_mass({name: nominal[name] for name in PARAMETER_NAMES})
        P0 = known_P(self.names, forgetting=1 - nu)
        self.rpem = Rpem(model, identify=self.names, P0=P0, forgetting=1 - nu, period=period)
        self.covariance = self.rpem.covariance

    def step(self, u, y):
        return self.rpem.step(u, y)

    def run(self, u, y, valid=None):
        theta = self.rpem.run(u, y)
        return np.concatenate([theta[:1].repeat(self.held, axis=0), theta])[: len(theta)]


class Late(Same):
    """The same, which keeps what it knows to itself for .6 s: as quiet, and slower by that."""

    held = HELD_BACK


class NoKnob(Same):
    knob = None


class Still:
    names, output, knob = ("f_m",), "speed", "gain"

    def __init__(self, nominal, period, *, gain=0.1):
        self.theta = [nominal["f_m"]]

    def step(self, u, y):
        return self.theta


def compared(candidate, scenarios, *, base="rpem-forgetting", seeds=8, **more):
    return fx.compare(base, candidate, scenarios=scenarios, seeds=seeds, match_std=True, **more)


def lag(found):
    (row,) = (row for row in found.content["rows"] if row["metric"] == "lag")
    return row


@pytest.mark.slow
def test_an_estimator_against_itself_with_another_knob_is_the_same(short):
    """The knob that was set is turned, so that both are one setting."""
    found = compared("rpem-forgetting[forgetting=0.98]", short)
    assert found.verdict == "same" and found.content["base"] == found.content["candidate"]
    assert lag(found)["change"] == 0


@pytest.mark.slow
def test_the_same_method_in_a_class_of_its_own_is_the_same(short):
    """Its knob has another name, scale and default: what is equal is the noise, not the number."""
    found = compared(Same, short)
    own = found.content["equal_noise"][1]
    # slight: a difference of some thousandths is seen where the pairs are so alike
    assert found.verdict in ("same", "slight")
    assert (own["match"], own["knob"]) == ("f_m", "nu")
    assert own["value"] == pytest.approx(0.005, rel=0.05)
    assert abs(np.log(own["ratio"])) < TOLERANCE
    assert abs(lag(found)["change"]) < 0.002  # straight between two turns of a smooth curve
    assert {row["metric"] for row in found.content["rows"]} - {"never_settled"} == {"lag"}


@pytest.mark.slow
def test_one_that_is_slower_is_worse_though_its_knob_made_it_quick(short):
    """Held back by .6 s, and so quick by its knob that it looks better where noise is not equal."""
    unfair = fx.compare("rpem-forgetting", Late, scenarios=short, seeds=8)
    rows = {(r["metric"], r["parameter"]): r for r in unfair.content["rows"]}
    assert rows["lag", "f_m"]["change"] < -0.05 and rows["std", "f_m"]["change"] > 0.5
    found = compared(Late, short, seeds=24)
    row = lag(found)
    assert found.verdict == "worse"
    # of the 2 s after the fault; what is left of its error at their end has no time to be made up
    assert 0.25 < row["candidate"] - row["base"] < 0.6


@pytest.mark.slow
def test_faults_in_several_parameters_are_compared_at_equal_excess_error(short):
    other = find_scenario("kt_step-v1").override(SHORT)
    found = compared("rpem-forgetting[forgetting=0.99]", [short, other], seeds=3)
    assert found.content["equal_noise"][0]["match"] == "excess" and found.verdict == "same"


@pytest.mark.parametrize(
    ("candidate", "said"),
    [
        ("frozen", "frozen has no tuning parameter, so its noise cannot be matched"),
        (NoKnob, "NoKnob has no tuning parameter, so its noise cannot be matched"),
        (Still, "has no noise to match"),
        ("pipe:cat", "pipe:cat has no tuning parameter, so its noise cannot be matched"),
    ],
)
def test_who_cannot_be_matched_is_refused_with_the_reason(short, candidate, said):
    with pytest.raises(FlexaxisError, match=said):
        compared(candidate, short, seeds=2)


def test_on_the_command_line(capsys, short_toml, tmp_path):
    words = ["compare", str(short_toml), "--base", "rpem-forgetting", "--candidate",
             "rpem-forgetting[forgetting=0.98, robust=5]", "--match-std", "--seeds", "3",
             "--jobs", "1", "-o", str(tmp_path / "out")]  # fmt: skip
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["equal_noise"][0]["match"] == "f_m" and told["gaps"] == []
    setting = told["equal_noise"][1]["setting"]
    assert "robust=5" in setting and "forgetting=0.99" in setting  # other options stay
    assert told["candidate"] == setting
    for name in ("report.html", "verdict.md"):
        text = text_of((tmp_path / "out" / name).read_text(encoding="utf-8"))
        assert "tuned to the std of f_m" in text
