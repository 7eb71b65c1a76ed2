"""What the words of the pages mean: shown by hover and by keyboard wherever `term` marks one."""

TERMS = {
    "lag": "The area under the remaining error after the fault, as a fraction of it, in seconds: "
    "an estimator that never moves has the length of the window.",
    "bound": "The Cramér–Rao bound: no unbiased estimator that is told when the fault happens, and "
    "takes all estimated parameters for unknown after it, does better.",
    "× bound": "The lag over the lag that the Cramér–Rao bound allows at the same noise; 1 is "
    "on it.",
    "std": "Standard deviation of the estimate before the fault, in per cent of nominal.",
    "std after": "Standard deviation of the estimate in the last 2 s of the window after the "
    "fault.",
    "bias": "Mean error of the estimate before the fault, in per cent of nominal.",
    "score": "0 for doing nothing, 100 on the Cramér–Rao bound; the mean over the faults for which "
    "the bound is defined.",
    "at equal noise": "Each estimator's knob is turned until its estimate is exactly as noisy as "
    "that of the reference; only then are lags compared.",
    "knob": "The one option of an estimator that buys speed with noise, such as the forgetting "
    "factor λ.",
    "forgetting factor": "λ: the weight of a sample falls by this factor with each new one, so "
    "that the last 1/(1−λ) samples count.",
    "excess error": "The mean prediction error beyond that of the true parameters, over σ²: noise "
    "and bias of all parameters in one number.",
    "false alarms": "Changes that an estimator says it found where nothing had changed, in 1000 s.",
    "detection": "How often, and how soon after a fault, an estimator says that something changed.",
    "cross-talk": "How far the estimates of parameters that did not change move after a fault, in "
    "per cent of nominal.",
    "efficiency": "Root mean square error 1 s after the fault over the bound with all parameters "
    "unknown; below 1 knows more, for example that only one has changed.",
    "diverged": "Not finite, or at the edge of the common box of .1 … 10 × nominal for more than "
    "1 s; from then on it counts as if it sat at the farther edge.",
    "burn-in": "The time at the beginning in which estimators settle; no score counts it.",
    "seed": "What the random parts of a run are drawn from: the same seed is the same run.",
    "interval": "95 % interval over the seeds, by the bootstrap.",
    "tie": "Marked ★: the best, and all that pairs on common seeds cannot tell from it at 5 %.",
    "t10": "Time after the fault until the error stays below 10 % of it.",
    "nominal": "The parameters of the axis as designed, on which θ is given: 1 is nominal.",
    "scenario": "An axis, its excitation and what happens to it, frozen under a name.",
    "fault": "A change of a physical parameter at a known time.",
    "control": "An estimator that bounds the field and takes no part: doing nothing, or told all.",
    "ECDF": "Share of all runs whose lag is at most so many times the bound: higher and more to "
    "the left is better.",
}
