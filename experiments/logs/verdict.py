"""What speaks against an identification, and what to type next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.descent import CONVERGED
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt
from flexaxis.experiments.logs.friction import linear_part, names_of
from flexaxis.experiments.logs.late import taken_as, too_late
from flexaxis.experiments.logs.laws import Tried
from flexaxis.experiments.logs.left_out import LeftOut, left_out
from flexaxis.experiments.logs.spectrum import Response

Array = NDArray[np.float64]

BLIND = 0.5  # relative standard deviation from which on a parameter counts as not seen
COLOURED = 0.1  # correlation of white residuals, one to twenty samples apart, that is too much:
# with ρ the variance of an estimate is up to (1 + ρ)/(1 − ρ) of what is claimed, here 1.2
LAGS = 20
LEVEL = "f_c"  # of dry friction: what a law is about, where its other parameters are its shape
EXPLAINED = 0.1  # of the motion, that a simulation may leave and still be of the same axis
APART = 0.2  # median of |log G/Ĝ|: a model that far from what the log shows is another axis


@dataclass(frozen=True)
class Verdict:
    """What is said of a result.

    Attributes
    ----------
    warnings : tuple of str
        What speaks against it.
    remarks : tuple of str
        What was found or done besides.
    correlation : float
        Largest correlation of the white residual with its past.
    condition : float
        Effect of the relative change of the parameters that the data see best, over that of the
        one they see least.
    weakest : str
        The latter, in words.
    misfit : float
        Median of |log G/Ĝ| over the band of the excitation.
    """

    warnings: tuple[str, ...]
    remarks: tuple[str, ...]
    correlation: float
    condition: float
    weakest: str
    misfit: float


def judge(
    attempt: Attempt,
    fitted: Fitted,
    deviations: Array,
    *,
    seen: Response | None,
    tried: Sequence[Tried],
    word: str,
    smooth: bool = False,
    blind: bool = False,
) -> Verdict:
    """Return the verdict on a fit.

    Parameters
    ----------
    attempt, fitted
    deviations : ndarray (q,)
        Of the unknowns.
    seen : Response or None
    tried : sequence of Tried
    word : str
        Of the law that was taken.
    smooth : bool
        Whether the record has its torque as a smooth one.
    blind : bool
        Whether friction could not be looked for, as slow motion was filtered away at the import.
    """
    correlation, misfit = _correlation(fitted), _misfit(attempt, fitted, seen)
    condition, weakest = _weakest(attempt, fitted)
    late = too_late(attempt, fitted, deviations, smooth)
    warnings = [
        *_blind(attempt, fitted, deviations, seen),
        *_bounds(attempt, fitted),
        *_restless(fitted),
        *late,
        *_coloured(correlation, fitted),
        *_apart(misfit),
        *_rubs(tried, word),
        *_unlooked(blind),
        *_left_out(left_out(attempt, fitted, deviations)),
    ]
    return Verdict(
        tuple(warnings),
        tuple(
            [
                *taken_as(attempt, fitted, smooth or bool(late)),
                *_laws(tried),
                *_shapeless(attempt, fitted),
            ]
        ),
        correlation,
        condition,
        weakest,
        misfit,
    )


def _correlation(fitted: Fitted) -> float:
    e = fitted.white[fitted.good]
    past = np.array([e[k:] @ e[: len(e) - k] for k in range(1, LAGS + 1)]) / (e @ e)
    return float(past[np.argmax(abs(past))])


def _misfit(attempt: Attempt, fitted: Fitted, seen: Response | None) -> float:
    """Return the median distance of model and response, in logarithms.

    Where a simulation explains the log, it is the response that is poor: one that dry friction, or
    a controller, is a part of.
    """
    good = fitted.good
    if seen is None or np.std(fitted.residual[good]) < EXPLAINED * np.std(attempt.log.y[good]):
        return 0.0
    model = attempt.having(attempt.values(fitted)).model
    linear = linear_part(model)
    names = [name for name in attempt.names if name in linear.parameters]
    chosen = linear if attempt.log.output == "speed" else increment(linear, attempt.log.period)
    form = chosen.parametrize(names or linear.parameters)
    gain, _ = frequency_response(form, form.theta, seen.omega, period=attempt.log.period)
    ratio = gain / seen.gain * np.exp(-1j * seen.omega * fitted.z[-1])
    return float(np.median(abs(np.log(ratio))))


def _weakest(attempt: Attempt, fitted: Fitted) -> tuple[float, str]:
    """Return the condition, and what is known least, in words."""
    p = len(attempt.names)
    theta = fitted.z[:p]
    scale = np.where(theta == 0, 1.0, theta)
    relative = fitted.covariance[:p, :p] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(np.clip(relative, -1e100, 1e100))
    least, change = float(np.sqrt(max(values[-1], 0.0))), vectors[:, -1]
    change = change * np.sign(change[np.argmax(abs(change))])
    largest = float(np.max(abs(change)))
    parts = ", ".join(
        f"{name} {share / largest:+.1f} %"
        for name, share in zip(attempt.names, change, strict=True)
        if abs(share) > largest / 10
    )
    # variances more than 1e-16 apart are rounding
    condition = float(np.sqrt(values[-1] / max(values[0], 1e-16 * values[-1], 1e-300)))
    return condition, (
        f"known least is a change in the proportion {parts}: to ±{100 * least * largest:.2g} % of "
        "the largest"
    )


def _blind(attempt: Attempt, fitted: Fitted, deviations: Array, seen: Response | None) -> list[str]:
    band = ""
    if seen is not None:
        low, high = seen.omega[[0, -1]] / (2 * np.pi)
        band = f" ({low:.3g} … {high:.3g} Hz)"
    lawful = set(names_of(attempt.model))
    found = []
    for name, value, s in zip(attempt.names, fitted.z, deviations, strict=False):
        if s < BLIND * abs(value) or (name in lawful and name != "f_c"):
            continue
        share = f"±{100 * s / abs(value):.0f} %" if value else "nothing"
        if name == "f_c":
            text = (
                f"dry friction f_c = {value:.3g} ± {s:.2g} cannot be told from none: use "
                "--friction none, or a longer log with slow and fast motion"
            )
        else:
            text = (
                f"the excitation{band} cannot see {name}: known to {share}; fix it with --fix "
                f"{name}=VALUE, or excite what it acts on"
            )
        found.append(text)
    return found


def _stuck(attempt: Attempt, fitted: Fitted) -> tuple[list[str], list[str]]:
    """Return what is at its bound: levels and linear parameters, and what shapes a law."""
    problem = attempt.problem()
    at = (fitted.z <= problem.lower * (1 + 1e-9)) | (fitted.z >= problem.upper * (1 - 1e-9))
    stuck = [
        name for name, side in zip(attempt.names, at[: len(attempt.names)], strict=True) if side
    ]
    shapes = [name for name in names_of(attempt.model) if name != LEVEL]
    return [n for n in stuck if n not in shapes], [n for n in stuck if n in shapes]


def _bounds(attempt: Attempt, fitted: Fitted) -> list[str]:
    found, (stuck, _) = [], _stuck(attempt, fitted)
    if LEVEL in stuck:
        stuck.remove(LEVEL)
        found += [
            f"{LEVEL}: at the bound of what dry friction may be; the log does not determine it: "
            "use --friction none, or a longer log with slow and fast motion"
        ]
    if stuck:
        found += [
            f"{', '.join(stuck)}: at the bound of the search; the log does not determine it, so "
            f"fix it with --fix {stuck[0]}=VALUE, or start elsewhere with --start {stuck[0]}=VALUE"
        ]
    return found


def _shapeless(attempt: Attempt, fitted: Fitted) -> list[str]:
    """Return which shape of a law has come to its limit, such as bristles that do not give."""
    shapes = ", ".join(_stuck(attempt, fitted)[1])
    text = "at the limit of the law, which is a simpler law; the value means no more than that"
    return [f"{shapes}: {text}"] if shapes else []


def _restless(fitted: Fitted) -> list[str]:
    """Return that the last step was still a good part of a standard deviation."""
    if fitted.converged:
        return []
    return [
        "the fit did not converge: its last step still moved estimates by more than "
        f"{CONVERGED:g} standard deviations; use --start NAME=VALUE from these estimates, or fix "
        "with --fix NAME=VALUE what is known least"
    ]


def _unlooked(blind: bool) -> list[str]:
    if not blind:
        return []
    return [
        "friction was not looked for, as slow motion was filtered away, and viscous friction may "
        "be dry: import without --highpass, `flexaxis identify --highpass HZ` filters residuals "
        "itself (or say --friction none)"
    ]


def _coloured(correlation: float, fitted: Fitted) -> list[str]:
    if abs(correlation) <= max(COLOURED, 4 / np.sqrt(fitted.good.sum())):
        return []
    return [
        f"what the model leaves out is not noise: white residuals correlate by {correlation:.2f} "
        "with their past; try another --model, --highpass HZ below the excitation, or --start "
        "NAME=VALUE"
    ]


def _apart(misfit: float) -> list[str]:
    if misfit <= APART:
        return []
    return [
        f"the model is {100 * np.expm1(misfit):.0f} % off the frequency response that the log "
        "shows: look at the page; try another --model or --friction, or --start NAME=VALUE"
    ]


def _left_out(found: Sequence[LeftOut]) -> list[str]:
    """Return the torque that explains most of what was left out, if it is one beyond chance."""
    most = [each for each in found[:1] if each.there]
    return [
        f"the axis has what the model leaves out: {each.what}; with it the error of a prediction "
        f"is {100 * (1 - np.exp(-each.gain)):.2g} % smaller, and the noise model hides it"
        + (
            f"; without it {each.name} is off by {each.moves:.1f} of its deviations or more"
            if each.name and each.moves > 1
            else ""
        )
        + f"; {each.advice}"
        for each in most
    ]


def _rubs(tried: Sequence[Tried], word: str) -> list[str]:
    """Return what a law that was asked not to be there would have explained."""
    if word != "none":
        return []
    return [
        f"there is dry friction, which a linear model takes for viscous friction: with {t.name} "
        f"friction the error of a prediction of held-out pieces is {t.comparison.after:.4g} and "
        f"not {t.comparison.before:.4g}; use --friction auto"
        for t in tried
        if t.taken
    ]


def _laws(tried: Sequence[Tried]) -> list[str]:
    lines = []
    for t in tried:
        c = t.comparison
        lines.append(
            f"{t.name} friction against {t.against}: error of a prediction of "
            f"{'held-out pieces' if t.held else 'the log it was fitted to'} "
            f"{c.before:.4g} → {c.after:.4g} ({100 * (c.after / c.before - 1):+.2g} %), "
            f"{'better' if t.taken else 'not worth its parameters'}"
        )
    return lines
