"""Tests for your own suite: the estimator keeps the rules and is no worse than another one."""

import flexaxis as fx

MINE = "my_estimator.py:Mine"


def test_my_estimator_keeps_the_rules():
    """Fails if the class breaks a rule; the message has the table of rules."""
    rules = fx.check(MINE)
    broken = rules[[holds is False for holds in rules["holds"]]]
    assert broken.empty, broken.to_string()


def test_my_change_is_no_regression():
    """Takes about a minute: 32 seeds of one scenario."""
    verdict = fx.compare("rpem-forgetting", MINE, scenarios="fm_step-v1", jobs=2)
    assert verdict.verdict != "worse", verdict
