"""
Print what is measured of every registered estimator, as plain text.

``python tests/estimators/tables.py [units rates starts disturbances claims] [--only NAME …]``
"""

import argparse
import sys
import warnings
from collections.abc import Callable, Iterable
from functools import cache, partial

import numpy as np
from acceptance.axes import AXES
from acceptance.disturbances import DISTURBANCES
from acceptance.measures import AGES, claims, make, outcome, stepped, undisturbed, unit_error
from acceptance.units import CHANGES, Units

from flexaxis.estimators.registry import REGISTRY

PERIODS = (0.001, 0.002, 0.005, 0.01)
STARTS = (0.5, 0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.5, 2.0)
FRESH = 3000  # seeds below are for tuning
CASES = [(axis, period) for axis in AXES for period in PERIODS]


def say(title: str, columns: Iterable[str], row: Callable[[str, str], str], names) -> None:
    """Print a row for each estimator; what raises says so in its cell."""
    columns = list(columns)
    print(f"\n{title}\n")
    print(f"{'':24}", *(f"{column:>14}" for column in columns), flush=True)
    for name in names:
        print(f"{name:24}", end=" ")
        for column in columns:
            try:
                cell = row(name, column)
            except Exception as error:
                cell = type(error).__name__
            print(f"{cell:>14}", end=" ", flush=True)
        print()


def units(names: list[str], runs: int) -> None:
    """How far θ̂ in other units is from θ̂ in SI, at most, relative."""
    keys = {f"{axis} {1e3 * period:g} ms": (axis, period) for axis, period in CASES}

    def cell(change: Units, name: str, key: str) -> str:
        axis, period = keys[key]
        seconds = 4.0 if name == "literal-rpem" else 20.0
        error = unit_error(name, change, axis=axis, period=period, seconds=seconds, seed=FRESH)
        return f"{error:.1e}"

    for change in CHANGES:
        title = f"{change.name}: largest relative difference of θ̂ (limit 1e-6)"
        say(title, keys, partial(cell, change), names)


def rates(names: list[str], runs: int) -> None:
    """Error after 40 s from a start 20 % off."""
    keys = {f"{axis} {1e3 * period:g} ms": (axis, period) for axis, period in CASES}

    def cell(name: str, key: str) -> str:
        axis, period = keys[key]
        given = undisturbed(axis, period, seed=FRESH)
        return str(outcome(make(name, axis=axis, period=period, start=1.2), given))

    say("start 1.2, 40 s: rms error of the last 5 s in % (findings)", keys, cell, names)


def starts(names: list[str], runs: int) -> None:
    """Error after 40 s from other starts."""
    given = undisturbed("n1", 0.005, seed=FRESH)
    say(
        "n1, 5 ms, 40 s, by start: rms error of the last 5 s in % (findings)",
        map(str, STARTS),
        lambda name, key: str(outcome(make(name, start=float(key)), given)),
        names,
    )


def disturbances(names: list[str], runs: int) -> None:
    """Error a minute after a disturbance."""
    drawn = cache(lambda key: DISTURBANCES[key](AXES["n1"], seed=FRESH))
    print("\na minute after: rms error of the last 5 s in % (findings, those at rest)\n")
    short = {f"D{i}": key for i, key in enumerate(DISTURBANCES, 1)}
    for column, key in short.items():
        print(f"  {column} {key}")

    def cell(name: str, column: str) -> str:
        found = outcome(make(name), drawn(short[column]))
        return f"{found}{f' rest {found.at_rest}' if found.at_rest else ''}"

    say("", short, cell, names)


def nees(names: list[str], runs: int) -> None:
    """Claims before and after a fault."""
    drawn = {seed: stepped("n1", 11.2, at=10.0, seed=seed) for seed in range(FRESH, FRESH + runs)}
    found = cache(lambda name: claims(name, drawn))
    keys = {"before": 0} | {f"+{age}": 1 + i for i, age in enumerate(AGES)}

    def cell(name: str, key: str) -> str:
        with np.errstate(all="ignore"):
            return f"{found(name).mean[keys[key]]:.2f} ± {found(name).deviation[keys[key]]:.2f}"

    say(f"f_m +50 %, {runs} runs: NEES/p by samples after it (1 is right)", keys, cell, names)


TABLES = {
    "units": units,
    "rates": rates,
    "starts": starts,
    "disturbances": disturbances,
    "claims": nees,
}


def main(arguments: list[str]) -> None:
    """Print the tables asked for, all by default."""
    warnings.simplefilter("ignore")  # a literal filter that winds up overflows; its cell says so
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", choices=[*TABLES, []], default=[])
    parser.add_argument("--only", nargs="+", choices=list(REGISTRY), default=list(REGISTRY))
    parser.add_argument("--runs", type=int, default=50, help="for the claims (50)")
    given = parser.parse_args(arguments)
    for name in given.tables or TABLES:
        TABLES[name](given.only, given.runs)


if __name__ == "__main__":
    main(sys.argv[1:])
