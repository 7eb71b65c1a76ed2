"""Check the claims of the paper.

The file ``claims.toml`` contains the text of each claim, the measure that tests the claim, and
limits for the measured values. If limits are not sufficient to test a claim, this module contains
an additional condition.
"""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.paper.measures import Measures
from flexaxis.experiments.scoring.scores import finite

CLAIMS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
"""Claims in the same order as in the paper, keyed by the id of the claim."""
PEAKS = (95.0, 125.0, 185.0)
"""Frequencies of the peaks in the torque spectrum according to the paper [rad/s]."""


def nearest_half_of_P(ratios: pd.Series) -> bool:
    """Return whether the measured variances are closer to σ²P/2 than to σ²P or σ²P/4.

    The argument `ratios` contains the measured standard deviations divided by √(σ²P/2). The
    standard deviations for σ²P and σ²P/4 differ from √(σ²P/2) by a factor of √2, so the geometric
    mean of `ratios` must differ from one by a factor of less than 2^¼.
    """
    return bool(abs(np.log2(ratios).mean()) < 0.25)


CONDITIONS: Mapping[str, Callable[[pd.Series], Any]] = {
    "derivative-for-friction": lambda d: [*d.index] == ["(3,3)"],
    "gradient-is-the-derivative": lambda errors: len(errors) == 12,
    "peaks-of-the-torque": lambda w: len(w) == 3 and np.allclose(w, PEAKS, rtol=0, atol=8),
    "order-of-the-gradients": lambda p: p["f_m"] > p["1/J_a"] > p["k_T"],
    "offline-reports-the-free-scale": lambda s: s["condition"] > 1e10 and s["unnamed"] == 0,
    "torque-constant-is-fastest": lambda t63: t63["k_T"] < t63.drop("k_T").min(),
    "inertia-and-friction-alike": lambda t90: 0.6 <= t90["f_m"] / t90["1/J_a"] <= 1.7,
    "P-differs-with-forgetting": lambda P: P.max() > 20 * P.min(),
    "P-is-even-with-modification": lambda P: P.max() < 3 * P.min(),
    "torque-constant-is-slower": lambda t63: t63["modification"] > 2 * t63["forgetting"],
    "torque-constant-is-quieter": lambda std: std["modification"] < std["forgetting"],
    "friction-is-noisier": lambda std: std["modification"] > 3 * std["forgetting"],
    "variance-with-forgetting": nearest_half_of_P,
    "variance-with-modification": nearest_half_of_P,
    # with a smaller μ, P approaches its bound more slowly
    "regularisation-bounds-modification": lambda p: p["μ = 10"] >= 0.98,
    "regularisation-stops-the-burst": lambda burst: burst["μ = 0"] > 100 and burst["μ = 1"] < 20,
    "reset-can-be-too-large": lambda loss: loss.max() > 3,
}
"""Additional conditions for claims that limits alone cannot test, keyed by the id of the claim."""


def holds(name: str, measured: pd.Series) -> bool:
    """Return whether the measured values satisfy the limits and the condition of a claim.

    Without an additional condition, a claim holds only if it has at least one measured value.
    """
    limits = CLAIMS[name].get("between", [-np.inf, np.inf])
    condition = CONDITIONS.get(name, len)
    return bool(measured.between(*limits).all() and condition(measured))


def decide(name: str, evidence: Measures) -> dict[str, Any]:
    """Check a claim of the paper, and return its entry for the file claims.json.

    The measured values are keyed by the names of the identified parameters. If there is only one
    measured value, its key is ``value``. Measured values that are not finite are replaced by None.
    """
    claim = CLAIMS[name]
    result = getattr(evidence, claim["measure"])(*claim.get("with", ()))
    if not isinstance(result, dict):
        names = evidence.names if np.ndim(result) else ["value"]
        result = dict(zip(names, np.ravel(result), strict=True))
    words = {key: claim[key] for key in ("claim", "source", "expected")}
    measured = {key: finite(value) for key, value in result.items()}
    held = holds(name, pd.Series(result, dtype=float))
    return {"id": name} | words | {"measured": measured, "holds": held}
