"""The shipped models, by name: one, two and three masses."""

from collections.abc import Callable, Mapping

from flexaxis.estimators.models.model import Model

PAPER = ("k_T", "1/J_a", "f_m")  # what the paper identifies


def one_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return a rigid motor with viscous friction: J_m ω̇ = k_T u − f_m ω.

    Parameters
    ----------
    nominal : mapping
        Nominal k_T, inertia J_m and friction f_m [SI].

    Returns
    -------
    Model
        Input: motor torque command. Output: motor speed [rad/s].
    """
    return Model(
        name="one_mass",
        states=("speed_motor",),
        A=(("-f_m/J_m",),),
        B=("k_T/J_m",),
        C=("1",),
        nominal=dict(nominal),
    )


def three_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return the paper's axis: motor, gear and arm, two springs; eq. (3), (4).

    Parameters
    ----------
    nominal : mapping
        Nominal k_T, J_m, J_g, J_a, k_g, k_a, d_g, d_a, f_m, f_g, f_a, r [SI].

    Returns
    -------
    Model
        Input: motor torque command. Output: motor speed [rad/s].
    """
    return Model(
        name="three_mass",
        states=("twist_gear", "twist_arm", "speed_motor", "speed_gear", "speed_arm"),
        A=(
            ("0", "0", "r", "-1", "0"),
            ("0", "0", "0", "1", "-1"),
            ("-r*k_g/J_m", "0", "-(r^2*d_g + f_m)/J_m", "r*d_g/J_m", "0"),
            ("k_g/J_g", "-k_a/J_g", "r*d_g/J_g", "-(f_g + d_g + d_a)/J_g", "d_a/J_g"),
            ("0", "k_a/J_a", "0", "d_a/J_a", "-(d_a + f_a)/J_a"),
        ),
        B=("0", "0", "k_T/J_m", "0", "0"),
        C=("0", "0", "1", "0", "0"),
        nominal=dict(nominal),
        identify=PAPER,
    )


def two_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return a motor that drives a load through one elastic shaft without a gear.

    Parameters
    ----------
    nominal : mapping
        Nominal k_T, inertias J_m (motor) and J_l (load), stiffness k and damping d of the shaft,
        friction f_m and f_l [SI].

    Returns
    -------
    Model
        Input: motor torque command. Output: motor speed [rad/s].
    """
    return Model(
        name="two_mass",
        states=("twist", "speed_motor", "speed_load"),
        A=(
            ("0", "1", "-1"),
            ("-k/J_m", "-(d + f_m)/J_m", "d/J_m"),
            ("k/J_l", "d/J_l", "-(d + f_l)/J_l"),
        ),
        B=("0", "k_T/J_m", "0"),
        C=("0", "1", "0"),
        nominal=dict(nominal),
    )


MODELS: Mapping[str, Callable[[Mapping[str, float]], Model]] = {
    "one_mass": one_mass,
    "two_mass": two_mass,
    "three_mass": three_mass,
}
"""The shipped models; each is made from its nominal values."""
