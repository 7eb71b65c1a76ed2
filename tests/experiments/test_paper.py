"""The paper on little data: every check decides, every figure draws, the page stands alone."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.paper import reproduce
from flexaxis.experiments.paper.claim import Claim, above, below, gather, half_of_P, within
from flexaxis.experiments.paper.data import Size
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.paper.reproduce import render
from flexaxis.experiments.reporting.page import symbols

# Seeds below 100: what is reported is on others. The least for which the claims that are
# statistical can hold; 15 s.
LITTLE = Size(first=0, runs=8, long=2, few=8)


@pytest.fixture(scope="module")
def evidence():
    return gather(LITTLE)


@pytest.fixture(scope="module")
def claims(evidence):
    return reproduce.decide(evidence)


@pytest.mark.slow
def test_there_are_44_claims_and_every_one_holds(claims):
    assert len({claim.id for claim in claims}) == len(claims) == 44
    assert [claim.id for claim in claims if not claim.holds] == []


def test_limits_are_what_they_say():
    assert within(0, 1)({"a": 0.0, "b": 1.0}) and not within(0, 1)({"a": 0.5, "b": 1.1})
    assert not within(0, 1, least=3)({"a": 0.5, "b": 0.5}) and not within(0, 1)(np.nan)
    assert below(1)(0.9) and not below(1)({"a": 0.0, "b": 1.0}) and not below(1)(np.nan)
    assert above(1)(1.1) and not above(1)({"a": 2.0, "b": 1.0}) and not above(1)(np.nan)
    near = {"a": 1.1, "b": 0.9}
    assert half_of_P(0.3)(near) and not half_of_P(0.05)(near)
    # of σ² P, √2 of σ² P/2, all lie within 40 %, and nearer to another value
    assert not half_of_P(0.5)({"a": 2**0.5, "b": 2**0.5})


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_draws(evidence, name):
    for ax in FIGURES[name](evidence).axes:
        curves = [line for line in ax.lines if len(line.get_ydata())]
        assert curves and all(np.isfinite(line.get_xydata().astype(float)).all() for line in curves)
        assert ax.get_ylabel()


@pytest.mark.slow
def test_the_page_tells_every_claim_and_needs_no_network(evidence, claims):
    wrong = [replace(claims[0], holds=False), *claims[1:]]
    page = render(evidence, wrong, "flexaxis paper")
    text = re.sub("<[^>]+>", "", page)
    for claim in wrong:
        assert re.sub("<[^>]+>", "", str(symbols(claim.claim))) in text
    held = sum(claim.holds for claim in wrong)
    assert f"{held} of {len(wrong)} claims hold" in text
    assert page.count('<svg role="img"') == len(FIGURES)
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(re.fullmatch(r"#.*|fig\w\.(png|svg)", link) for link in links)


@pytest.mark.parametrize("holds", [True, False])
def test_a_claim_that_fails_is_a_finding(monkeypatch, capsys, tmp_path, holds):
    made = [Claim("sun-rises", "The sun rises", "Fig. 0", 1.0, "1", holds)]
    monkeypatch.setattr(reproduce, "reproduce", lambda *args, **options: made)
    assert main(["paper", "-o", str(tmp_path)]) == (0 if holds else 1)
    out = capsys.readouterr().out
    assert "The sun rises" in out
    assert out.splitlines()[-1] == str(tmp_path / "index.html")
    assert main(["paper", "-o", str(tmp_path), "--json"]) == (0 if holds else 1)
    assert json.loads(capsys.readouterr().out)["claims"][0]["holds"] is holds


def test_a_folder_that_cannot_be_written_is_said_at_once(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    assert main(["paper", "-o", str(tmp_path / "file")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert main(["paper", "--jobs", "0"]) == 2
