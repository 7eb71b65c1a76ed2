"""What an axis has beyond the linear model: dry friction, and play in the gear."""

from __future__ import annotations

from flexaxis.sim.config import Config, Positive

SUBSTEPS = 20  # of a sample: a switch of the force is located to within a step of 0.25 ms


class FrictionConfig(Config):
    """Friction of the motor that does not depend on the size of its speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction [N m]; it opposes the motion, and holds the motor up to that torque.
    """

    coulomb: Positive


class BacklashConfig(Config):
    """Play between the motor and the gear.

    Attributes
    ----------
    gear : float
        Width of the gap [rad on the arm side] within which the gear spring has no force. The damper
        of the gear acts in the gap too.
    """

    gear: Positive
