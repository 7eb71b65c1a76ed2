"""What an estimator is to reach on axes with friction, and on which scenarios."""

from collections.abc import Callable
from dataclasses import dataclass

from acceptance.friction_rows import Row

Limits = tuple[float, float]  # from, to

LITTLE = (  # friction of .1 N m at most, and a structure that a model can have
    "fm_step-v1",
    "coulomb05_fm_step-v1",
    "coulomb_fm_step-v1",
    "lugre_fm_step-v1",
    "cogging_told_fm_step-v1",
    "told_kg_fm_step-v1",
    "backlash_fm_step-v1",
    "stiffening_fm_step-v1",
    "saturation_told_fm_step-v1",
    "real_coulomb_fm_step-v1",
    "real_lugre_fm_step-v1",
)
HARD = ("lugre_soft_fm_step-v1", "lugre_stribeck_fm_step-v1")
MORE = ("coulomb2_fm_step-v1", *HARD)
ENCODERS = ("encoder_coulomb_fm_step-v1", "coarse_encoder_coulomb_fm_step-v1")
KNOWN = (*LITTLE, *MORE)
"""Structure that a model of the suite can have: f_m +50 %."""

OTHERS = ("coulomb_fc_step-v1", "coulomb_ja_step-v1", "coulomb_kt_step-v1")
"""The axis with .1 N m, other faults."""

CONFUSED = (
    "coulomb_kt_step-v1",
    "coulomb_ja_step-v1",
    "coulomb_fm_step-v1",
    "coulomb_fc_step-v1",
    "coulomb_jm_step-v1",
    "coulomb_kg_step-v1",
)
WG = (
    "wg_fm_step-v1",
    "wg_fc_step-v1",
    "wg_kg_step-v1",
    "wg_ja_step-v1",
    "wg_kt_step-v1",
    "wg_wear-v1",
    "wg_warming-v1",
)
UNKNOWN = (
    "directional_fm_step-v1",
    "position_fm_step-v1",
    "load_friction_fm_step-v1",
    "power_fm_step-v1",
    "wrong_poles_fm_step-v1",
    "temperature_fm_step-v1",
    "torque_noise_fm_step-v1",
    "noisy_loop_fm_step-v1",
)
MOVES = ("coulomb_moves_fm_step-v1", *ENCODERS)
QUIET = ("paper_nominal-v1", "coulomb-v1", "warming_coulomb-v1", "coulomb2-v1", "wg_warming-v1")
"""Without a fault: every alarm is a false one."""


@dataclass(frozen=True)
class Given:
    """What a limit may depend on: the scenario, its row, and that of plain forgetting."""

    scenario: str
    row: Row
    plain: Row


@dataclass(frozen=True)
class Column:
    """A column: heading, value of a row, how it is printed, and what it is to be."""

    heading: str
    value: Callable[[Row], float | None]
    form: str = ".2f"
    limits: Callable[[Given], Limits | None] = lambda given: None

    def cell(self, given: Given) -> str:
        """The number; an exclamation mark where it misses its target."""
        value, limits = self.value(given.row), self.limits(given)
        if value is None:
            return "–"
        missed = limits is not None and not limits[0] <= value <= limits[1]
        return f"{value:{self.form}}{'!' if missed else ''}"

    def target(self, given: Given) -> str:
        """The limits in words."""
        limits = self.limits(given)
        if limits is None:
            return ""
        low, high = limits
        if low == -high != 0:
            return f"±{high:{self.form}}"
        if low == 0.0:
            return f"≤{high:{self.form}}"
        return f"≥{low:{self.form}}"


def _bias(name: str) -> Callable[[Given], Limits | None]:
    def limits(given: Given) -> Limits | None:
        if given.scenario == "fm_step-v1":  # zero within its interval, 95 %
            error = given.row.error.get(name, 0.0)
            return -2 * error, 2 * error
        if name == "f_c":
            most = 2.0 if given.scenario in (*LITTLE, *OTHERS, *ENCODERS) else 4.0
        else:
            most = 2.0 if given.scenario in HARD else 1.0
        return -most, most

    return limits


def _std(name: str) -> Callable[[Given], Limits | None]:
    def limits(given: Given) -> Limits | None:
        return (0.0, 1.0 if name == "f_c" else given.plain.std[name])

    return limits


def _lag(given: Given) -> Limits | None:
    if given.scenario == "coulomb_fc_step-v1":
        return 0.0, 0.4
    if given.scenario == "fm_step-v1":
        return 0.0, 0.12
    if given.scenario in (*LITTLE, *OTHERS, *ENCODERS):
        return 0.0, 0.15
    row = given.row
    bound = row.lag / row.efficiency["tracked"] if row.lag and row.efficiency else 0.0
    return 0.0, max(0.2, 1.4 * bound)


def _efficiency(given: Given) -> Limits | None:
    return 0.0, 1.4 if given.scenario in (*LITTLE, *OTHERS, *ENCODERS) else 2.0


def _found(given: Given) -> Limits | None:
    return (95.0 if given.scenario == "coulomb2_fm_step-v1" else 97.0), 100.0


def _covered(given: Given) -> Limits | None:
    """90 to 99 %; that all intervals hold the truth says nothing before some hundred runs."""
    return 90.0, 99.0 if given.row.runs > 300 else 100.0


def _of(table: str, name: str) -> Callable[[Row], float | None]:
    return lambda row: getattr(row, table).get(name)


SHOWN = {"k_T": "k_T", "J_a": "1/J_a", "f_m": "f_m", "f_c": "f_c"}
"""Physical parameters, and what is estimated of them."""

ESTIMATES = tuple(
    Column(f"{table} {short}", _of(table, name), ".2f", limit(name))
    for table, limit in (("bias", _bias), ("std", _std))
    for name, short in SHOWN.items()
)
CHANGES = (
    Column("lag", lambda row: row.lag, ".3f", _lag),
    Column("t10", lambda row: row.t10, ".2f", lambda given: (0.0, 0.35)),
    Column("×one", _of("efficiency", "one"), ".2f"),
    Column("×bound", _of("efficiency", "tracked"), ".2f", _efficiency),
    Column("×struct", _of("efficiency", "structure"), ".2f"),
    Column("found", lambda row: row.found, ".0f", _found),
    Column("named", lambda row: row.named, ".0f"),
    Column("1s on", lambda row: row.renamed, ".0f", lambda given: (95.0, 100.0)),
    Column("cover", lambda row: row.covered, ".0f", _covered),
)
REST = (
    Column("false", lambda row: row.false, ".1f", lambda given: (0.0, 1.0)),
    Column("more", lambda row: row.further, ".2f"),
    Column("lost", lambda row: row.lost, "d", lambda given: (0, 0)),
    Column("µs", lambda row: row.cost, ".1f"),
)
COLUMNS = (*ESTIMATES, *CHANGES, *REST)


def _not_worse(table: str, name: str) -> Callable[[Given], Limits | None]:
    """No more than 10 % above that of plain forgetting."""

    def limits(given: Given) -> Limits | None:
        most = 1.1 * abs(getattr(given.plain, table)[name])
        return -most, most

    return limits


UNKNOWN_COLUMNS = (
    *(
        Column(f"{table} {short}", _of(table, name), ".2f", _not_worse(table, name))
        for table in ("bias", "std")
        for name, short in SHOWN.items()
        if name != "f_c"
    ),
    *(Column(c.heading, c.value, c.form) for c in CHANGES),
    Column("alarms/min", lambda row: row.alarms, ".2f", lambda given: (0.0, 1.0)),
    *(c for c in REST if c.heading != "false"),
)
