"""The paper: what decides a claim, and, slowly, that all hold, are drawn, and notice a mistake."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline import priors
from flexaxis.experiments.cli import main
from flexaxis.experiments.paper import evidence
from flexaxis.experiments.paper.claim import Check, above, below, half_of_P, within
from flexaxis.experiments.paper.claims import CHECKS
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.paper.measures import Measures, worst
from flexaxis.experiments.paper.reproduce import render
from flexaxis.sim.plant.loop import Changes
from flexaxis.sim.simulate import simulate

# Seeds below 100: what is reported is on others. The least for which the claims that are
# statistical can hold.
LITTLE = {"first": 0, "sizes": {"nominal": 8, "long": 2, "calm": 16, "others": 8}}


def test_limits_are_what_they_say():
    def measured(*values):
        return pd.Series(values, dtype=float)

    assert within(0, 1)(measured(0, 1)) and not within(0, 1)(measured(0.5, 1.1))
    assert not within(0, 1, least=3)(measured(0.5, 0.5)) and not within(0, 1)(measured(np.nan))
    assert below(1)(measured(0.9)) and not below(1)(measured(0, 1.1))
    assert above(1)(measured(1.1)) and not above(1)(measured(2, np.nan))
    near = measured(1.1, 0.9)
    assert half_of_P(0.3)(near) and not half_of_P(0.05)(near)
    # of σ² P, √2 of σ² P/2, all lie within 40 %, and nearer to another value
    assert not half_of_P(0.5)(measured(2**0.5, 2**0.5))
    np.testing.assert_allclose(worst([[0.1, 1.1, 5.0], [2.0, 0.95, 0.5]]), [10, 1.1, 5])


def test_a_claim_is_strict_json_and_has_its_own_name():
    names = SimpleNamespace(names=("k_T", "f_m"))
    for measured, result in ((np.array([1.0, np.inf]), {"k_T": 1.0, "f_m": None}),
                            (2.0, {"value": 2.0}), ({"a": 3}, {"a": 3.0})):  # fmt: skip
        claim = Check("i", "s", "c", "e", lambda e, m=measured: m, below(2.5))(names)
        assert json.loads(json.dumps(claim, allow_nan=False))["measured"] == result
        assert claim["holds"] is (result == {"value": 2.0})
    assert len({check.id for check in CHECKS}) == len(CHECKS) == 44


@pytest.mark.slow
def test_all_claims_hold_on_little_data_and_every_figure_draws():
    e = Measures(**LITTLE)
    claims = [check(e) for check in CHECKS]
    assert not [claim for claim in claims if not claim["holds"]]
    for draw, *_ in FIGURES.values():
        for ax in draw(e).axes:
            curves = [line.get_xydata() for line in ax.lines if len(line.get_ydata())]
            assert curves and all(np.isfinite(curve.astype(float)).all() for curve in curves)
            assert ax.get_ylabel()
    page = render(e, [claims[0] | {"holds": False}, *claims[1:]])
    assert "43 of 44 claims hold" in re.sub("<[^>]+>", "", page)
    assert all(check.source in page for check in CHECKS)
    assert page.count('<svg role="img"') == len(FIGURES) and "src=" not in page


@pytest.mark.slow
def test_flexaxis_paper(tmp_path, capsys):
    assert main(["paper", "-o", str(tmp_path), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    claims = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))
    assert printed["claims"] == claims and all(claim["holds"] for claim in claims)
    names = [f"fig{i}.{kind}" for i in range(3, 10) for kind in ("svg", "png")]
    for name in (*names, "index.html"):
        assert (tmp_path / name).stat().st_size > 1000


def failed(*ids):
    e = Measures(**LITTLE)
    return {check.id for check in CHECKS if check.id in ids and not check(e)["holds"]}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", ["sign", "shift", "late", "drift"])
def test_a_mistake_is_noticed(mistake, monkeypatch):
    """In the derivative of A; of torque or parameters by one sample; in the order of Δ."""
    blocks, records = Parametrization.blocks, evidence.records

    def wrong_blocks(self, theta):
        result = blocks(self, theta)
        if "f_m" in self.names:  # the entry −1/J_m of eq. (24)
            result[1 + self.names.index("f_m"), 2, 2] *= -1
        return result

    def late(*args, **options):
        made = records(*args, **options)
        return [replace(r, torque=np.r_[0, r.torque[:-1]]) for r in made]

    ids = {
        "sign": ["derivative-for-friction", "gradient-is-the-derivative", "forgetting-converges"],
        "shift": ["model-predicts-the-plant", "offline-finds-the-parameters"],
        "late": ["faults-come-on-time"],
        "drift": ["P-is-even-with-modification", "friction-is-noisier"],
    }[mistake]
    if mistake == "sign":
        monkeypatch.setattr(Parametrization, "blocks", wrong_blocks)
    elif mistake == "shift":
        monkeypatch.setattr(evidence, "records", late)
    elif mistake == "late":
        make = Changes.make
        monkeypatch.setattr(Changes, "make", lambda self, plant, k: make(self, plant, k - 1))
        monkeypatch.setattr(evidence, "records", lambda *args: simulate(*args[:2]))
    else:
        turned = dict(zip(priors.DRIFT, reversed(priors.DRIFT.values()), strict=True))
        monkeypatch.setattr(priors, "DRIFT", turned)
    assert failed(*ids) == set(ids)
