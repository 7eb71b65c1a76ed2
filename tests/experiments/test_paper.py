"""The paper: what decides a claim, and, slowly, that all hold, are drawn, and notice a mistake."""

import inspect
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flexaxis.estimators.models import series
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline import priors
from flexaxis.experiments.cli import main
from flexaxis.experiments.paper import evidence
from flexaxis.experiments.paper.claims import CLAIMS, CONDITIONS, decide, holds
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

    on_time, winds_up = "faults-come-on-time", "forgetting-winds-up"
    assert holds(on_time, measured(0, 0)) and not holds(on_time, measured(0, 1))
    assert not holds(on_time, measured()) and not holds(on_time, measured(0, np.nan))
    assert holds(winds_up, measured(2e6)) and not holds(winds_up, measured(5e5))
    # 1.39 is within 40 %, but nearer to the deviation of σ² P, √2 times that of σ² P/2
    half = "variance-with-modification"
    assert holds(half, measured(1.1, 0.9)) and not holds(half, measured(1.5, 0.9))
    assert not holds(half, measured(1.39, 1.39))
    np.testing.assert_allclose(worst([[0.1, 1.1, 5.0], [2.0, 0.95, 0.5]]), [10, 1.1, 5])


def test_a_claim_is_strict_json_and_can_be_measured(monkeypatch):
    words = {"claim": "c", "source": "s", "expected": "e"}
    claim = words | {"measure": "made", "with": [1.0], "between": [0, 2.5]}
    monkeypatch.setitem(CLAIMS, "i", claim)
    for measured, result in ((np.array([1.0, np.inf]), {"k_T": 1.0, "f_m": None}),
                            (2.0, {"value": 2.0}), ({"a": 3}, {"a": 3.0})):  # fmt: skip
        evidence = SimpleNamespace(names=("k_T", "f_m"), made=lambda x, m=measured: m)
        claim = decide("i", evidence)
        assert json.loads(json.dumps(claim, allow_nan=False))["measured"] == result
        assert claim["holds"] is (result == {"value": 2.0})


def test_every_claim_names_a_measure_and_is_decided_by_something():
    assert len(CLAIMS) == 44 and set(CONDITIONS) < set(CLAIMS)
    for name, claim in CLAIMS.items():
        inspect.signature(getattr(Measures, claim["measure"])).bind("self", *claim.get("with", ()))
        assert "between" in claim or name in CONDITIONS


@pytest.mark.slow
def test_all_claims_hold_on_little_data_and_every_figure_draws():
    e = Measures(**LITTLE)
    claims = [decide(name, e) for name in CLAIMS]
    assert not [claim for claim in claims if not claim["holds"]]
    for draw, *_ in FIGURES.values():
        for ax in draw(e).axes:
            curves = [line.get_xydata() for line in ax.lines if len(line.get_ydata())]
            assert curves and all(np.isfinite(curve.astype(float)).all() for curve in curves)
            assert ax.get_ylabel()
    page = render(e, [claims[0] | {"holds": False}, *claims[1:]])
    assert "43 of 44 claims hold" in re.sub("<[^>]+>", "", page)
    assert all(claim["source"] in page for claim in claims)
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
    return {name for name in ids if not decide(name, e)["holds"]}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", ["slope", "shift", "late", "drift"])
def test_a_mistake_is_noticed(mistake, monkeypatch):
    """In derivatives; of torque or parameters by one sample; in the order of Δ."""
    blocks, tables, records = Parametrization.blocks, series._tables, evidence.records

    def wrong_blocks(self, theta):
        result = blocks(self, theta)
        if "f_m" in self.names:  # the entry −1/J_m of eq. (24)
            result[1 + self.names.index("f_m"), 2, 2] *= -1
        return result

    def wrong_tables(model, coefficient):
        entries, made = tables(model, coefficient)
        swapped = np.arange(1 + len(model.names))  # derivatives by f_m and by the first parameter
        swapped[[1, 1 + model.names.index("f_m")]] = 1 + model.names.index("f_m"), 1
        made["slopes"]["lane"] = swapped[made["slopes"]["lane"]]
        return entries, made

    def late(*args, **options):
        made = records(*args, **options)
        return [replace(r, torque=np.r_[0, r.torque[:-1]]) for r in made]

    ids = {
        "slope": ["derivative-for-friction", "gradient-is-the-derivative", "forgetting-converges"],
        "shift": ["model-predicts-the-plant", "offline-finds-the-parameters"],
        "late": ["faults-come-on-time"],
        "drift": ["P-is-even-with-modification", "friction-is-noisier"],
    }[mistake]
    if mistake == "slope":
        monkeypatch.setattr(Parametrization, "blocks", wrong_blocks)
        monkeypatch.setattr(series, "_tables", wrong_tables)
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
