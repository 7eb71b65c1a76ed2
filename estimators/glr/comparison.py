"""
Decide which parameter jumped, by running the filter again with each candidate jump.

The hypothesis bank approximates the effect of a parameter jump as linear in the jump size, which is
accurate only for small jumps. Therefore only the parameters with the most probable jumps become
candidates, each with its most probable onset. For each candidate jump, a second filter starts from
the state stored at the onset, applies the jump, and processes all later samples again. Each pass of
the second filter yields one Gauss–Newton step of the jump size; the number of steps is at most
`PASSES`. The comparison ranks the candidate jumps by their evidence, which combines the sum of the
normalised squared innovations e²/S with the prior probability. Until one candidate jump is clearly
the most probable, the estimate is the mean over all hypotheses. After the estimator has accepted a
candidate jump, the comparison with rival jumps is repeated a few times. A jump of another parameter
can still replace the accepted jump.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.glr.bank import ALARM, NEVER, level_of
from flexaxis.estimators.glr.workspace import Workspace
from flexaxis.estimators.protocol import Finding

Array = NDArray[np.float64]

LEAD = 4.5  # nats, smallest lead of an accepted candidate over every other parameter: 90 to 1
CANDIDATES = 3  # number of parameters for which the filter is re-run
PASSES = 3  # largest number of Gauss–Newton steps for each candidate
NEAR = 0.3  # standard deviations, Gauss–Newton step below which no further step is taken
AGAIN = 5  # an undecided comparison is repeated after 1/AGAIN of the time since the onset
REVIEWS = (0.15, 0.3, 0.6, 1.0)  # times of the reviews, relative to the time until a name is final
HOPELESS = ALARM + LEAD  # nats behind the accepted candidate at which a candidate is dropped
LEAST = 0.02  # smallest change that is reported, relative to the value of the parameter or to its
# scale, whichever is greater; a smaller change only corrects the estimate
FIELDS = ("J", "d", "size", "precision", "prior")  # arrays of the bank with a value per hypothesis
Z95 = 1.96  # half width of a 95 % interval in standard deviations


@dataclass
class _Candidate:
    """
    A candidate: a jump of one parameter at one onset.

    Attributes
    ----------
    index : int
        Index in θ of the parameter that jumps.
    variance : float
        Prior variance of the jump size.
    onset : int
        Index of the sample at which the parameter jumps.
    size : float
        Jump size in units of the parameter scale.
    xi, P : (m,), (m, w) arrays
        State and covariance of the filter at the onset.
    chi2 : float
        Sum of the normalised squared innovations e²/S over all samples until the onset.
    path : float
        Sum of the log priors of the candidate jump and of all jumps that were accepted before.
    spread : float
        Standard deviation of the jump size over the probable onsets in the hypothesis bank.
    instead : bool
        Whether the candidate would replace the last detected jump, rather than add a further jump.
    evidence : float
        Log-likelihood ratio between the filters with and without the candidate jump.
    deviation : float
        Standard deviation of the jump size.
    penalty : float
        Log prior of the candidate jump, including the prior of the jump size.
    total : float
        Sum of the normalised squared innovations e²/S over all samples if the candidate jump is
        applied.
    passes : int
        Number of completed Gauss–Newton steps.
    """

    index: int
    variance: float
    onset: int
    size: float
    xi: Array
    P: Array
    chi2: float
    path: float
    spread: float = 0.0
    instead: bool = False
    evidence: float = -np.inf
    deviation: float = np.nan
    penalty: float = 0.0
    total: float = 0.0
    passes: int = 0

    @property
    def before(self) -> float:
        """Value of the parameter before the jump; NaN if it does not differ clearly from zero."""
        value, variance = float(self.xi[self.index]), float(self.P[self.index, self.index])
        return value if value**2 > Z95**2 * variance else np.nan


class Comparison:
    """
    The comparison of candidate jumps, and the list of detected jumps.

    Parameters
    ----------
    work : Workspace
        Memory of the glr estimator.
    origin : int
        Index of the sample at which the filter started.
    findings : sequence of Finding
        Jumps that were detected before the filter started at ``origin``.

    Attributes
    ----------
    origin : int
        Index of the sample at which the filter started.
    findings : list of Finding
        All jumps that have been detected so far.
    """

    def __init__(self, work: Workspace, origin: int, findings: Sequence[Finding]) -> None:
        self._work, self.origin, self.findings = work, origin, list(findings)
        self._path = 0.0
        self._last: _Candidate  # the candidate that was accepted last
        self.forget()

    def begin(self) -> None:
        """Start comparing the most probable jumps, and the rivals of the last detected jump."""
        self._compare([*self._best(), *self._rest])

    def review(self) -> None:
        """Compare the last detected jump with its rivals again, and update the jump size."""
        self._others: list[float] = []  # evidence of the other parameters
        rest, states, last = self._rest, self._work.states, self._last
        theta, P = states["theta"][0, last.index], states["P"][0, last.index, last.index]
        self.findings[-1] = replace(self.findings[-1], **_sized(last.before, theta, np.sqrt(P)))
        self._schedule()
        if rest:
            self._compare(rest)

    def forget(self) -> None:
        """Declare the last detected jump final, and clear all candidates."""
        self._work.bank["due"] = NEVER
        self._candidates: list[_Candidate] = []
        self._todo: list[_Candidate] = []
        self._rest: list[_Candidate] = []  # candidates that may replace the last finding
        self._chosen: _Candidate | None = None

    def go_on(self) -> bool:
        """Continue the comparison after a filter pass; return whether a jump was detected."""
        if self._chosen is not None:
            return self._take(self._chosen)
        candidate = self._todo[0]
        before, step = candidate.size, self._weigh(candidate)
        candidate.size += step
        if (
            not np.isfinite(candidate.evidence)
            or candidate.passes >= PASSES
            or abs(step) < NEAR * candidate.deviation
            or self._inside(candidate) == before
        ):
            self._todo.pop(0)
        if self._todo:
            self._pass(self._todo[0], self._now)
        else:
            self._decide()
        return False

    def _best(self) -> list[_Candidate]:
        """Return the most probable jumps, at most one per parameter, each at its best onset."""
        bank, which = self._work.bank, self._work.bank["which"]
        fields = (bank[name].reshape(-1, len(which)) for name in FIELDS)
        J, d, size, precision, prior = fields
        gain = d * size / bank["kappa"] - np.log1p(J / (bank["kappa"] * precision))
        evidence = 0.5 * gain + prior
        rows, best = evidence.argmax(axis=0), evidence.max(axis=0)
        order = [int(j) for j in np.argsort(-best) if np.isfinite(best[j])]
        self._others = [float(best[j]) for j in order[CANDIDATES:]]
        found = []
        earlier = {c.index: c for c in self._candidates if not c.instead}
        for j in order[:CANDIDATES]:
            row, i = rows[j], int(which[j])
            likely = np.exp(evidence[:, j] - best[j])
            spread = float(np.cov(size[:, j], aweights=likely, bias=True)) ** 0.5
            path, onset = self._path + float(prior[row, j]), int(bank["onset"][row])
            before, spacing = earlier.get(i), self._work.timing.base << level_of(int(row))
            if before and abs(before.onset - onset) < spacing:  # its onset is more exact
                found.append(replace(before, path=path, spread=spread))
                continue
            kept = bank["kept"][row].copy()
            found.append(
                _Candidate(
                    index=i,
                    variance=float(bank["variance"][j]),
                    onset=onset,
                    size=float(size[row, j]),
                    xi=kept[-1, : len(kept) - 1],
                    P=kept[:-1],
                    chi2=float(bank["chi2_at"][row]),
                    path=path,
                    spread=spread,
                )
            )
        return found

    def _compare(self, candidates: Sequence[_Candidate]) -> None:
        bank = self._work.bank
        self._candidates, self._todo = list(candidates), list(candidates)
        for candidate in candidates:
            candidate.passes = 0
        self._kappa, self._now = float(bank["kappa"]), int(bank["taken"])
        self._chi2 = float(bank["chi2"])
        self._pass(self._todo[0], self._now)

    def _inside(self, candidate: _Candidate) -> float:
        """Return the jump size, limited so that the parameter remains within its bounds."""
        i, design = candidate.index, self._work.design
        start = candidate.xi[i]
        return float(np.clip(start + candidate.size, design.lower[i], design.upper[i]) - start)

    def _pass(self, candidate: _Candidate, end: int | None) -> None:
        """Start a filter pass over all samples since the onset, with the candidate jump applied."""
        i, bank = candidate.index, self._work.bank
        candidate.size = self._inside(candidate)
        xi = candidate.xi.copy()
        xi[i] += candidate.size
        self._work.go_through(xi, candidate.P, candidate.onset, first=True, end=end)
        bank["one_D"] = 0.0
        bank["one_D"][i] = 1.0

    def _weigh(self, candidate: _Candidate) -> float:
        """Return the Gauss–Newton step after a filter pass, and update the candidate's evidence."""
        bank = self._work.bank
        J, d = (float(bank[name][0]) / self._kappa for name in ("one_J", "one_d"))
        prior = 1.0 / candidate.variance
        step = (d - candidate.size * prior) / (J + prior)
        candidate.passes += 1
        candidate.deviation = (J + prior) ** -0.5
        candidate.penalty = candidate.path - 0.5 * (
            (candidate.size + step) ** 2 * prior + float(np.log1p(J / prior))
        )
        candidate.total = float(bank["chi2_one"]) + candidate.chi2
        explained = 0.5 * (self._chi2 - candidate.total) / self._kappa
        ahead = 0.5 * J * step**2 + prior * step * (candidate.size + step)  # by the step
        evidence = explained + ahead + candidate.penalty - self._path
        candidate.evidence = evidence if np.isfinite(evidence) else -np.inf
        return step

    def _decide(self) -> None:
        """Accept the best candidate if it is clearly the most probable, or wait for more data."""
        best = max(self._candidates, key=lambda c: c.evidence)
        self._rest = [c for c in self._rest if c.evidence > -HOPELESS]
        others = [
            c.evidence
            for c in self._candidates
            if (c.index, c.instead) != (best.index, best.instead)
        ]
        lead = best.evidence - max([0.0, *others, *self._others])
        bank = self._work.bank
        if best.evidence > (LEAD if best.instead else ALARM) and lead > LEAD:
            self._chosen = best
            self._pass(best, None)
            return
        bank["busy"] = 0
        if not all(c.instead for c in self._candidates):
            bank["patience"] = self._now + max(1, (self._now - best.onset) // AGAIN)

    def _take(self, chosen: _Candidate) -> bool:
        """Continue from the accepted candidate's state; return whether a new jump is reported."""
        work, self._chosen = self._work, None
        bank = work.bank
        step, delta = self._weigh(chosen), bank["one_D"][:, 0].copy()
        chosen.deviation = float(np.hypot(chosen.deviation, chosen.spread))
        if not np.isfinite(step):
            self._candidates = []
            work.empty()
            return False
        work.move(step * delta)
        chosen.size += step
        work.states["P"][1][:, : len(delta)] += np.outer(delta, delta) * chosen.deviation**2
        work.adopt()
        bank["chi2"], self._path = chosen.total, chosen.penalty
        self._last, told = chosen, self._tell(chosen)
        self._rest = [
            replace(c, instead=True)
            for c in self._candidates
            if c is not chosen and c.instead == chosen.instead
        ]
        self._candidates = []
        if told:
            self._schedule()
        else:
            self.forget()
        return told and not chosen.instead

    def _schedule(self) -> None:
        """Schedule the next review of the last detected jump, or declare the jump final."""
        work, onset = self._work, self._last.onset
        reviews = (onset + round(part * work.timing.review) for part in REVIEWS)
        work.bank["due"] = next((at for at in reviews if at > work.now), NEVER)
        if work.bank["due"] == NEVER:
            self.forget()

    def _tell(self, chosen: _Candidate) -> bool:
        """Store the detected jump, and return whether the jump is large enough to be reported."""
        before, usual = chosen.before, max(abs(float(chosen.xi[chosen.index])), 1.0)
        if abs(chosen.size) < LEAST * usual:
            if chosen.instead:  # the replaced jump did not happen
                self.findings[-1:] = []
            return False
        finding = Finding(
            self._work.now + self.origin,
            chosen.onset + self.origin,
            (self._work.names[chosen.index],),
            **_sized(before, before + chosen.size, chosen.deviation),
        )
        if chosen.instead and self.findings:
            self.findings[-1] = replace(finding, alarm=self.findings[-1].alarm)
        else:
            self.findings.append(finding)
        return True


def _sized(before: float, after: float, deviation: float) -> dict[str, Any]:
    """Return the ratio of a parameter's values after and before a jump, and its 95 % interval."""
    ratio, half = after / before, Z95 * deviation / abs(before)
    return {"ratio": (float(ratio),), "interval": ((float(ratio - half), float(ratio + half)),)}
