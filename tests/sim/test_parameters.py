"""The parameters of an axis: read off its MJCF, validated, ordered, named."""

import numpy as np
import pytest

from flexaxis.sim.errors import ParameterError
from flexaxis.sim.parameters import PARAMETER_NAMES, AxisParameters, preset

ORDER = ["k_T", "J_m", "J_g", "J_a", "k_g", "k_a", "d_g", "d_a", "f_m", "f_g", "f_a", "r"]


def test_order_is_the_contract_and_survives_the_array():
    assert list(PARAMETER_NAMES) == ORDER
    n1 = preset("n1")
    assert AxisParameters(**dict(zip(ORDER, np.array([*n1.values()]), strict=True))) == n1
    assert (
        list(n1.as_dict()) == ORDER
        and list(n1.as_dict().values()) == np.array([*n1.values()]).tolist()
    )


@pytest.mark.parametrize("name", ORDER)
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_impossible_values_name_field_and_value(name, value):
    with pytest.raises(ParameterError, match=f"^{name}: .*must be .*not {value!r}"):
        preset("n1").replace(**{name: value})


@pytest.mark.parametrize("name", ORDER)
def test_zero_is_for_dampings_and_frictions_only(name):
    if name[0] in "df":
        assert getattr(preset("n1").replace(**{name: 0.0}), name) == 0
    else:
        with pytest.raises(ParameterError, match=name):
            preset("n1").replace(**{name: 0.0})


@pytest.mark.parametrize(("name", "modes"), [("n1", (100.2, 150.8)), ("n2", None)])
def test_presets_have_the_modes_they_are_meant_to_have(name, modes):
    p = preset(name)
    mass = np.diag([p.J_m, p.J_g, p.J_a])
    gear, arm = np.array([p.r, -1, 0]), np.array([0, 1, -1])
    stiffness = p.k_g * np.outer(gear, gear) + p.k_a * np.outer(arm, arm)
    found = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, stiffness))))
    found.sort()
    assert found[0] < 1e-3  # the whole axis turns freely
    if modes:  # damping moves the modes by less than a percent
        assert np.allclose(found[1:], modes, rtol=0.01)
