"""
Print what every registered estimator claims before and after a fault of f_m, over what is true.

``python tests/estimators/claims_tables.py [--only NAME …] [--runs 50]``
"""

import argparse
import warnings

import numpy as np
from acceptance.measures import AGES, claims, stepped

from flexaxis.estimators.registry import REGISTRY

FRESH = 3000  # seeds below are for tuning


def main() -> None:
    """Print a row for each estimator."""
    warnings.simplefilter("ignore")  # a literal filter that winds up overflows
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=list(REGISTRY), default=list(REGISTRY))
    parser.add_argument("--runs", type=int, default=50)
    given = parser.parse_args()
    seeds = range(FRESH, FRESH + given.runs)
    drawn = {seed: stepped("n1", 11.2, at=10.0, seed=seed) for seed in seeds}
    print(f"f_m +50 %, {given.runs} runs: NEES/p by samples after it (1 is right)\n")
    print(f"{'':24}", *(f"{column:>14}" for column in ("before", *(f"+{age}" for age in AGES))))
    for name in given.only:
        with np.errstate(all="ignore"):
            found = claims(name, drawn)
        cells = zip(found.mean, found.deviation, strict=True)
        print(f"{name:24}", *(f"{f'{m:.2f} ± {d:.2f}':>14}" for m, d in cells), flush=True)


if __name__ == "__main__":
    main()
