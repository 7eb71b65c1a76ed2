"""What the words of the pages mean: shown by hover and by keyboard wherever `term` marks one.

Scores are defined in `flexaxis.experiments.scoring.table` and nowhere else.
"""

from flexaxis.experiments.scoring.table import SCORES

TERMS = {score.heading: score.words for score in SCORES.values() if score.heading} | {
    "bound": "The Cramér–Rao bound for whoever is told when the fault happens, and takes all "
    "estimated parameters for unknown after it, with a wide prior: the mean size √(2/π)σ of a "
    "Gaussian error on it. Not what no estimator can beat: who finds out that only one parameter "
    "changed has a smaller one.",
    "× bound": "Geometric mean of the lag over the mean lag of the bound, computed from the "
    "torque of each record; who finds out that only one parameter has changed can "
    "be below 1.",
    "at equal noise": "Each estimator is run at several settings of its knob, and its lag "
    "interpolated between the two on either side of the noise of the reference; at exactly that "
    "noise it is not run.",
    "knob": "The one option of an estimator that buys speed with noise, such as the forgetting "
    "factor λ.",
    "forgetting factor": "λ: the weight of a sample falls by this factor with each new one, so "
    "that the last 1/(1−λ) samples count.",
    "false alarms": "Changes that the estimator says it found where nothing had changed, in 1000 s "
    "of motion.",
    "error over bound": "Root mean square error 200 samples after the fault (1 s at 5 ms) over the "
    "bound with all parameters unknown; below 1 knows more, for example that only one has changed.",
    "detection": "How often, and how soon after a fault, an estimator says that something changed.",
    "burn-in": "The time at the beginning in which estimators settle; no score counts it.",
    "seed": "What the random parts of a run are drawn from: the same seed is the same run.",
    "interval": "95 % interval over the seeds: Student’s t, for means with Hall’s correction for "
    "skewness, on the jackknife’s values where lags are interpolated to equal noise; of medians by "
    "order statistics. There is none with fewer than five seeds.",
    "tie": "Marked ★: the best, and all that pairs on common seeds cannot tell from it at 5 %.",
    "nominal": "The parameters of the axis as designed, on which θ is given: 1 is nominal.",
    "scenario": "An axis, its excitation and what happens to it, frozen under a name.",
    "fault": "A change of a physical parameter at a known time.",
    "control": "An estimator that bounds the field and takes no part: doing nothing, or told all.",
    "ECDF": "Share of all runs whose lag is at most so many times the bound: higher and more to "
    "the left is better.",
}
