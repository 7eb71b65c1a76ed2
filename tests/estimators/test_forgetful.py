"""What other rules of forgetting are for: a jump is followed, and rest is no harm."""

import pytest

from flexaxis.estimators import EstimatorError, Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.registry import REGISTRY

NAMES = ("k_T", "1/J_a", "f_m")
P0 = known_P(NAMES, forgetting=0.995)
LAMBDA = 0.995


def forgetful_rpem(nominal, rule, **options):
    name = next(name for name in REGISTRY if name.startswith(rule))
    given = dict(forgetting=LAMBDA, robust=0.0) | options
    return REGISTRY[name].factory(three_mass(nominal), 0.005, P0=P0, **given)


@pytest.mark.parametrize("rule", ["variable", "cusum"])
def test_a_jump_is_followed_faster_and_rest_is_as_quiet(nominal, simulated, rule):
    run = simulated(14.0, seed=2, faults={8.0: nominal | {"f_m": 0.1}})
    plain = Rpem(three_mass(nominal), P0=P0, period=0.005).run(run.u, run.y)[:, 2]
    quick = forgetful_rpem(nominal, rule).run(run.u, run.y)[:, 2]
    lag = [abs(theta[1600:] - 0.1).sum() for theta in (plain, quick)]
    assert lag[1] < 0.6 * lag[0]
    assert quick[1000:1600].std() < 1.2 * plain[1000:1600].std()


def test_wrong_options(nominal):
    with pytest.raises(EstimatorError, match=r"reset is 0\.0"):
        forgetful_rpem(nominal, "cusum", reset=0.0)
