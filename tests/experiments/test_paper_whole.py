"""The paper in full, and three mistakes that its checks must notice."""

import json
from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline import priors
from flexaxis.experiments.cli import main
from flexaxis.experiments.paper import data, reproduce
from flexaxis.experiments.paper.claim import gather
from flexaxis.experiments.paper.data import Size

pytestmark = pytest.mark.slow

# As in test_paper.py, where without a mistake all claims hold.
SMALL = Size(first=0, runs=8, long=2, few=8)


def failed():
    return {claim.id for claim in reproduce.decide(gather(SMALL)) if not claim.holds}


def test_flexaxis_paper(tmp_path, capsys):
    assert main(["paper", "-o", str(tmp_path), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    claims = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))
    assert printed["claims"] == claims
    assert all(claim["holds"] for claim in claims)
    names = [f"fig{i}" for i in range(3, 10)]
    for name in [*(f"{n}.svg" for n in names), *(f"{n}.png" for n in names), "index.html"]:
        assert (tmp_path / name).stat().st_size > 1000


def test_a_sign_in_the_derivative_of_A_is_noticed(monkeypatch):
    right = Parametrization.blocks

    def wrong(self, theta):
        blocks = right(self, theta)
        if "f_m" in self.names:  # the entry −1/J_m of eq. (24)
            blocks[1 + self.names.index("f_m"), 2, 2] *= -1
        return blocks

    monkeypatch.setattr(Parametrization, "blocks", wrong)
    assert {"gradient-is-the-derivative", "derivative-for-friction"} <= failed()


def test_a_shift_of_the_torque_by_one_sample_is_noticed(monkeypatch):
    right = data.records

    def wrong(*args, **options):
        found, simulated = right(*args, **options)
        return [replace(r, torque=np.r_[0, r.torque[:-1]]) for r in found], simulated

    monkeypatch.setattr(data, "records", wrong)
    assert {"model-predicts-the-plant", "offline-finds-the-parameters"} <= failed()


def test_a_turned_round_drift_is_noticed(monkeypatch):
    turned = dict(zip(priors.DRIFT, reversed(priors.DRIFT.values()), strict=True))
    monkeypatch.setattr(priors, "DRIFT", turned)
    assert {"P-is-even-with-modification", "friction-is-noisier"} <= failed()
