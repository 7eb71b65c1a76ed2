"""The paper on little data: every check decides, every figure draws, the page stands alone."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.paper import reproduce
from flexaxis.experiments.paper.claim import Claim, above, below, gather, half_of_P, within
from flexaxis.experiments.paper.claims import CHECKS
from flexaxis.experiments.paper.data import Size
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.paper.model_measures import worst
from flexaxis.experiments.paper.reproduce import claims_table, in_words, render
from flexaxis.experiments.reporting.page import symbols
from flexaxis.experiments.reporting.terminal import lines, show

# Seeds below 100: what is reported is on others. The least for which the claims that are
# statistical can hold; 15 s.
LITTLE = Size(first=0, runs=8, long=2, few=8)


@pytest.fixture(scope="module")
def evidence():
    return gather(LITTLE)


@pytest.fixture(scope="module")
def claims(evidence):
    return reproduce.decide(evidence)


def test_there_are_44_claims_and_each_has_its_name(claims):
    assert len(claims) == 44
    assert len({claim.id for claim in claims}) == len(claims)
    assert all(claim.claim and claim.source and claim.expected for claim in claims)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.id)
def test_every_claim_holds(evidence, check):
    claim = check(evidence)
    assert claim.holds, claim


def test_limits_are_what_they_say():
    assert within(0, 1)({"a": 0.0, "b": 1.0}) and not within(0, 1)({"a": 0.5, "b": 1.1})
    assert not within(0, 1, least=3)({"a": 0.5, "b": 0.5}) and not within(0, 1)(np.nan)
    assert below(1)(0.9) and not below(1)({"a": 0.0, "b": 1.0}) and not below(1)(np.nan)
    assert above(1)(1.1) and not above(1)({"a": 2.0, "b": 1.0}) and not above(1)(np.nan)
    near = {"a": 1.1, "b": 0.9}
    assert half_of_P(0.3)(near) and not half_of_P(0.05)(near)
    # of σ² P, √2 of σ² P/2, all lie within 40 %, and nearer to another value
    assert not half_of_P(0.5)({"a": 2**0.5, "b": 2**0.5})


def test_the_worst_ratio_is_that_farthest_from_one():
    ratios = np.array([[0.1, 1.1, 5.0], [2.0, 0.95, 0.5]])
    np.testing.assert_array_equal(worst(ratios), [0.1, 1.1, 5.0])


def test_claims_are_strict_json(claims):
    plain = [claim.as_json() for claim in claims]
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert list(plain[0]) == ["id", "claim", "source", "measured", "expected", "holds"]
    endless = Claim("a", "b", "c", {"x": np.inf, "y": 1.0}, "d", False)
    assert endless.as_json()["measured"] == {"x": None, "y": 1.0}


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_draws(evidence, name):
    for ax in FIGURES[name](evidence).axes:
        curves = [line for line in ax.lines if len(line.get_ydata())]
        assert curves and all(np.isfinite(line.get_xydata().astype(float)).all() for line in curves)
        assert ax.get_ylabel()


def test_a_figure_is_written_twice_the_same(evidence, tmp_path):
    files = []
    for _ in range(2):
        reproduce.draw("fig3", evidence, tmp_path)
        files.append((tmp_path / "fig3.svg").read_text(encoding="utf-8"))
    assert files[0] == files[1] and "<svg" in files[0]
    assert (tmp_path / "fig3.png").read_bytes().startswith(b"\x89PNG")


class Links(HTMLParser):
    """Everything that a browser would load or follow."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found += [v for k, v in attrs if k in {"src", "href", "xlink:href", "data"}]


def test_the_page_tells_every_claim_and_needs_no_network(evidence, claims):
    wrong = [replace(claims[0], holds=False), *claims[1:]]
    page = render(evidence, wrong, "flexaxis paper")
    text = re.sub("<[^>]+>", "", page)
    for claim in wrong:
        assert re.sub("<[^>]+>", "", str(symbols(claim.claim))) in text
    held = sum(claim.holds for claim in wrong)
    assert f"{held} of {len(wrong)} claims hold" in text
    assert page.count('<svg role="img"') == len(FIGURES)
    assert all(re.fullmatch(r"#.*|fig\w\.(png|svg)", link) for link in Links(page).found)


def test_numbers_and_symbols_are_readable():
    assert in_words({"k_T": 0.6123, "f_m": 1576.2}) == "k_T: 0.612, f_m: 1576"
    assert str(symbols("1/J_a <")) == "1/<i>J</i><sub>a</sub> &lt;"


def test_the_table_shows_brackets(capsys):
    table = claims_table([Claim("a", "b", "c", 1.0, "t63 [s] of k_T", True)])
    show(lines("1", table.heads, [[cell.text for cell in table.rows[0][1]]], ""))
    assert "t63 [s] of k_T" in capsys.readouterr().out


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
