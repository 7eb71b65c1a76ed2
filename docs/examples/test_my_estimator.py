"""Tests for your own test suite: the estimator passes the rules and is not worse than another."""

import flexaxis as fx

MINE = "my_estimator.py:Mine"


def test_my_estimator_keeps_the_rules():
    """Fail if the class violates a rule; the message contains the table of rules."""
    rules = fx.check(MINE)
    broken = rules[[holds is False for holds in rules["holds"]]]
    assert broken.empty, broken.to_string()


def test_my_change_is_no_regression():
    """Compare on 32 seeds of one scenario, which takes about a minute."""
    verdict = fx.compare("rpem-forgetting", MINE, scenarios="fm_step-v1", jobs=2)
    assert verdict.verdict != "worse", verdict
