"""Test that your estimator obeys the benchmark rules and is not worse than another estimator."""

import flexaxis as fx

MINE = "my_estimator.py:Mine"


def test_my_estimator_keeps_the_rules():
    """Test that the estimator obeys the rules. On failure, the message lists the violated rules."""
    rules = fx.check(MINE)
    broken = rules[[holds is False for holds in rules["holds"]]]
    assert broken.empty, broken.to_string()


def test_my_change_is_no_regression():
    """Test that the estimator is not worse than rpem-forgetting on 32 seeds of one scenario."""
    verdict = fx.compare("rpem-forgetting", MINE, scenarios="fm_step-v1", jobs=2)
    assert verdict.verdict != "worse", verdict
