"""What docs/glr.py measures: findings against the truth, pools and pairs, axes of its own."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

sys.path.append(str(Path(__file__).parents[1] / "docs"))
import glr
import glr_own
import glr_pool
import glr_runs
import making
from glr_cases import CASES, SPOILT, Case

TELLER = """
from types import SimpleNamespace

class Teller:
    names, output = ("k_T", "1/J_a", "f_m"), "speed"
    covariance = [[1e-4, 0, 0], [0, 1.0, 0], [0, 0, 1e-6]]
    findings = ()

    def __init__(self, nominal, period, *, said=()):
        self.findings = [
            SimpleNamespace(alarm=a, onset=a, parameters=(p,), ratio=(r,), interval=((i, j),))
            for a, p, r, i, j in said
        ]

    def step(self, u, y):
        return [1.0, 1.25, 0.05]
"""  # θ at its nominal values, for good
RIGHT, LATE, OTHER = ('[2030, "1/J_a", 0.9, 0.85, 0.95]', '[3010, "f_m", 1.5, 1.4, 1.6]',
                      '[2030, "f_m", 1.5, 1.4, 1.6]')  # fmt: skip


@pytest.fixture
def told(tmp_path):
    """Runs of an estimator in a file that says what it is told to, of J_a × 1.1 at 2000."""
    (tmp_path / "teller.py").write_text(TELLER, encoding="utf-8")

    def run(*said, case="ja_step"):
        text = f"{tmp_path}/teller.py:Teller[said=[{', '.join(said)}]]"
        return glr_runs.run(Case(case, case), text, 0, tmp_path)

    return run


def test_a_finding_is_held_against_the_truth(told):
    right = told(RIGHT)
    (fault,) = right["faults"]
    assert fault["named"] == [fault["fault"]] == ["J_a"] and fault["covered"] is True
    assert fault["delay"] == pytest.approx(0.15)
    assert fault["size"] == pytest.approx(100 * (1 / 0.9 / 1.1 - 1))
    assert right["false"] == [] and right["calm"] == pytest.approx(15.0)
    late = told(LATE)
    assert "named" not in late["faults"][0] and late["false"] == [False]
    (row,) = glr_pool.pooled({}, [right, told(OTHER), late])
    assert (row["found"], row["faults"], row["wrong"], row["taken"]) == (2, 3, 1, "J_a:f_m×1")
    assert (row["cover"], row["covers"], row["false"]) == (1, 1, 1)
    assert row["lag"] == pytest.approx(5.0) and row["cross"] == row["bias"] == 0.0


def test_a_finding_is_that_of_the_fault_it_names_though_another_has_come_meanwhile(told):
    late, other = '[2210, "f_m", 1.5, 1.4, 1.6]', '[2220, "1/J_a", 0.9, 0.85, 0.95]'
    faults = told(late, other, case="two_faults")["faults"]  # f_m at 2000, J_a at 2200
    assert [f["named"] for f in faults] == [["f_m"], ["J_a"]]
    assert [f["delay"] for f in faults] == pytest.approx([1.05, 0.1])
    assert [f["more"] for f in faults] == [0, 0]


def test_claims_are_held_against_the_truth_before_and_after(told):
    before, *after = told()["claims"]
    assert before == {"nees": 0.0, "inside": 3, "of": 3}
    D = 1.25 * (1 - 1 / 1.1)  # claimed: 1
    assert [c["nees"] for c in after] == pytest.approx([D**2 / 3] * 3)


def test_what_moved_that_way_is_no_lie_where_nothing_is_a_fault(told):
    # J_a × 1.2 from 10 s on, 8 s of 16
    says = ('[2100, "1/J_a", 0.8, 0.7, 0.9]', '[2100, "1/J_a", 1.2, 1.1, 1.3]')
    assert told(*says, case="load")["false"] == [True, False]


def test_a_record_is_spoilt_where_it_is_said_to_be():
    time = np.arange(4000) / 200
    clean = SimpleNamespace(time=time, speed=np.sin(time), seed=3)
    rng = np.random.default_rng(0)
    made = {name: spoil(clean, rng) for name, spoil in SPOILT.items()}
    gone = ~made["gaps"]["valid"]
    assert gone[1400:1600].all() and 0.04 < np.delete(gone, np.s_[1400:1601]).mean() < 0.06
    assert np.ptp(made["stuck"]["speed"][1401:1600]) == 0.0 == made["stuck"]["speed"][0]
    apart = {name: made[name]["speed"] - clean.speed for name in ("drift", "outliers", "doubled")}
    assert apart["drift"][-1] == pytest.approx(0.02 * time[-1])
    assert np.flatnonzero(abs(apart["outliers"]) > 1e8).tolist() == [1400]
    assert apart["doubled"][2000:].std() == pytest.approx(0.173, rel=0.05)
    assert not apart["doubled"][:2000].any()


def test_the_best_of_the_others_is_taken_seed_by_seed():
    of = {"table": "t", "case": "c", "parameter": "f_m", "seeds": "0:5", "bound": 0.1}
    lags = np.array([0.1, 0.2, 0.3, 0.2, 0.1])
    mine = of | {"estimator": "a"} | glr_pool.of_lags((lags + 0.05).tolist())
    others = [of | {"estimator": e} | glr_pool.of_lags([*(k * lags), 7.0][: 5 + k])
              for e, k in (("b", 1), ("c", 2))]  # fmt: skip
    assert glr_pool.paired(mine, others) == "+0.50 (+0.50 … +0.50)"


def test_rows_that_are_kept_come_back(tmp_path, monkeypatch, told):
    monkeypatch.setattr(glr_pool, "KEPT", tmp_path / "data" / "glr.csv")
    of = {"table": "linear", "case": "ja_step", "estimator": "gone", "seeds": "0:2"}
    rows = glr_pool.pooled(of, [told(RIGHT), told(LATE)])
    fewer = glr_pool.pooled(of | {"seeds": "0:1"}, [told(LATE)])
    for again in (fewer, rows, fewer, rows):
        glr_pool.keep(again)
    (back,) = glr_pool.stored()
    assert {k: v for k, v in back.items() if isinstance(v, str)}.items() >= of.items()
    assert back["lag"] == pytest.approx(5.0) and back["false"] == 1
    assert "| ja_step, 1/J_a | `gone` | 5" in glr.followed([back], [])


@pytest.mark.parametrize("own", glr_own.OWN, ids=lambda own: own.name)
def test_an_own_axis_moves_as_its_equations_say(own):
    """Against LSODA, with the sign of the speed smoothed over 1e-3 rad/s."""
    moved = glr_own.mover(own.model, own.period)
    f_c, n = own.model.nominal.get("f_c", 0.0), len(own.model.A)
    A, B = glr_own.matrices(own.model)
    motor = own.model.states.index("speed_motor")

    def rate(t, x):
        dry = f_c * np.tanh(x[motor] / 1e-3) / own.model.nominal["J_m"]
        return A @ x + B[:, 0] * u - dry * np.eye(n)[motor]

    x = y = np.zeros(n)
    u, angle, found, wanted = 0.0, 0.0, [], []
    for k in range(round(0.2 / own.period)):
        u = 1.0 if k * own.period < 0.1 else -0.7
        x, turned, _ = moved(x, u)
        angle += turned
        y = solve_ivp(rate, (0, own.period), y, "LSODA", rtol=1e-8, atol=1e-8).y[:, -1]
        found, wanted = [*found, x[motor]], [*wanted, y[motor]]
    assert angle == pytest.approx(own.period * np.sum(wanted), abs=own.period * max(wanted))
    assert np.allclose(found, wanted, atol=(2e-2 if f_c else 1e-6) * np.abs(wanted).max())


def test_what_is_below_its_friction_sticks():
    own = next(o for o in glr_own.OWN if "f_c" in o.identify)
    x, turned, dry = glr_own.mover(own.model, own.period)(np.zeros(3), 0.09)
    assert abs(x).max() < 1e-9 and turned == pytest.approx(0.0, abs=1e-12)
    assert dry == pytest.approx(0.09)


def test_every_case_is_a_scenario_with_its_own_name():
    for table, cases in CASES.items():
        assert len({case.name for case in cases}) == len(cases), table
        assert all(case.scenario.samples for case in cases)


def test_the_page_has_every_table():
    page = glr.PAGE.read_text(encoding="utf-8")
    found = {name for name, _ in making.MARK.findall(page)}
    assert found == {*glr.SOURCES, "cost", "shapes"}
