"""
Stream samples through an estimator for ever, and print whether it stays sound.

``python tests/scale/stream.py rpem-forgetting --samples 1e8`` (or ``--minutes 15``)

Motion data of 100 s, ten periods of the reference, are repeated with fresh noise, in chunks.
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
        Largest error of an estimate after the first chunk, relative to the truth.
    grown : float
        Peak memory since the first chunk [MB].
    """

    samples: int
    seconds: float
    finite: bool
    least: float
    error: float
    grown: float


def stream(name: str, *, samples: float = np.inf, seconds: float = np.inf) -> Streamed:
    """Take so many samples, or as many as so much processor time allows."""
    run = simulate(AXES["n1"], 1.5 * CHUNK * 0.005)
    part = slice(len(run.u) - CHUNK, None)  # the start from rest has died away
    u, clean, truth = run.u[part], run.clean[part], run.theta[-1]
    estimator, noise = make(name), np.random.default_rng(0)
    taken, begun, finite, least, error, before = 0, time.process_time(), True, np.inf, 0.0, 0.0
    while taken < samples and time.process_time() - begun < seconds:
        theta = estimator.run(u, clean + SIGMA * noise.standard_normal(CHUNK))
        finite &= bool(np.isfinite(theta).all())
        least = min(least, smallest(estimator.covariance))
        if taken:
            error = max(error, float(np.abs(theta / truth - 1).max()))
        before = before or peak()
        taken += CHUNK
    return Streamed(taken, time.process_time() - begun, finite, least, error, peak() - before)


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
    given = asked.parse_args()
    for name in given.names:
        s = stream(name, samples=given.samples, seconds=60 * given.minutes)
        print(
            f"{name:20} {s.samples:.2e} samples in {s.seconds:.0f} s, finite {s.finite}, "
            f"eigenvalue ≥ {s.least:.2g}, error ≤ {100 * s.error:.2g} %, +{s.grown:.1f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
