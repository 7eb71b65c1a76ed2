"""
Stream samples through an estimator for ever, and print whether it stays sound.

``python tests/scale/stream.py rpem-forgetting --samples 1e8`` (or ``--minutes 15``)

Motion data of 100 s, ten periods of the reference, are repeated with fresh noise, in chunks. With
``--faults 20`` every twentieth chunk is of an axis with a fault: more friction, or a lighter arm.
"""

import argparse
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))

from acceptance.axes import AXES, SIGMA, simulate
from acceptance.measures import make

CHUNK = 20_000  # samples, ten periods of the reference
SETTLED = 2_000  # of those, the last: what was to be learnt has been
FAULTS = ({}, {"f_m": 1.5}, {"J_a": 0.8})  # factors of parameters, a chunk each


@dataclass(frozen=True)
class Streamed:
    """
    What came of a stream.

    Attributes
    ----------
    samples : int
    seconds : float
        Of processor time.
    finite : bool
        Every estimate.
    least : float
        Smallest eigenvalue of the claimed covariance as correlations, over all chunks.
    error : float
        Largest error of an estimate at the end of a chunk but the first, relative to the truth.
    grown : float
        Peak memory since the first chunk, or since the first fault of each kind [MB].
    """

    samples: int
    seconds: float
    finite: bool
    least: float
    error: float
    grown: float


def stream(
    name: str, *, samples: float = np.inf, seconds: float = np.inf, faults: int = 0
) -> Streamed:
    """Take so many samples, or as many as so much processor time allows.

    With `faults` a chunk of so many is of an axis with a fault, one of each kind in turn.
    """
    parts = [_part(factors) for factors in (FAULTS if faults else FAULTS[:1])]
    estimator, noise = make(name), np.random.default_rng(0)
    taken, begun, finite, least, error, before = 0, time.process_time(), True, np.inf, 0.0, 0.0
    while taken < samples and time.process_time() - begun < seconds:
        chunk = taken // CHUNK
        fault = chunk // faults % 2 + 1 if faults and chunk % faults == faults - 1 else 0
        u, clean, truth = parts[fault]
        theta = estimator.run(u, clean + SIGMA * noise.standard_normal(CHUNK))
        finite &= bool(np.isfinite(theta).all())
        least = min(least, smallest(estimator.covariance))
        if taken:
            error = max(error, float(np.abs(theta[-SETTLED:] / truth - 1).max()))
        if chunk >= 2 * faults:  # what is compiled at the first alarms is there
            before = before or peak()
        taken += CHUNK
    return Streamed(taken, time.process_time() - begun, finite, least, error, peak() - before)


def _part(factors):
    """Return a chunk: torque, speed without noise, and the true θ."""
    axis = {name: value * factors.get(name, 1.0) for name, value in AXES["n1"].items()}
    run = simulate(axis, 1.5 * CHUNK * 0.005)
    part = slice(len(run.u) - CHUNK, None)  # the start from rest has died away
    return run.u[part], run.clean[part], run.theta[-1]


def smallest(covariance) -> float:
    """Return the smallest eigenvalue of a covariance as correlations; NaN where it is none."""
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    return float(np.linalg.eigvalsh(correlation)[0]) if np.isfinite(correlation).all() else np.nan


def peak() -> float:
    """Return the most memory that this process ever had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print a line for each estimator."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("names", nargs="+")
    asked.add_argument("--samples", type=float, default=np.inf)
    asked.add_argument("--minutes", type=float, default=15.0)
    asked.add_argument("--faults", type=int, default=0, help="chunks from one to the next")
    given = asked.parse_args()
    for name in given.names:
        s = stream(name, samples=given.samples, seconds=60 * given.minutes, faults=given.faults)
        print(
            f"{name:20} {s.samples:.2e} samples in {s.seconds:.0f} s, finite {s.finite}, "
            f"eigenvalue ≥ {s.least:.2g}, error ≤ {100 * s.error:.2g} %, +{s.grown:.1f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
