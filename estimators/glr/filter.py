"""A joint Kalman filter with a bank of hypotheses, as an estimator."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.fault_monitor import begin_anew
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.filters.joint import joint_arrays
from flexaxis.estimators.glr.cogging import strongest_wave
from flexaxis.estimators.glr.comparison import ALARM, Comparison
from flexaxis.estimators.glr.first_seconds import FirstSeconds
from flexaxis.estimators.glr.loop import glr
from flexaxis.estimators.glr.records import Jumps, Timing, bank_of
from flexaxis.estimators.glr.workspace import Workspace, take_up
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.protocol import Finding

Array = NDArray[np.float64]

COMPARING, LEARNING = 1 / 8, 3 / 4  # of the budget, as which a look at re-run samples counts


class Glr(RecursiveEstimator):
    """
    A joint Kalman filter with a bank of hypotheses that learns the structure at initialisation.

    Parameters
    ----------
    design : Design
        Its parameters: first the tracked ones, then those that are learnt once.
    tracked : int
        Number of tracked parameters, the estimates.
    jumps : Jumps
    timing : Timing
    told : sequence of mapping of str to float
        Groups of parameters with values to which the estimates shrink unless the data contradict,
        see `flexaxis.estimators.filters.constrained`.
    fixable : mapping of str to str
        Parameters that are fixed if the data do not excite them, with the reason for
        `fixed_because`.
    shapes : mapping of tuple of str to tuple of str
        Levels of dry friction, and the shape parameters that matter if a level is not zero.
    waves : int
        Largest number of cogging waves per turn to look for; 0 for none.
    angle : int
        Index of the motor angle among the states, even if the model lacks it.
    torque_noise : mapping of str to float
        Its numbers, see `flexaxis.estimators.filters.state`; empty for a filter without it.
    richer : Glr, optional
        Filter with cogging as its last law, which takes over if cogging is found.

    Attributes
    ----------
    theta, covariance
        Mean and covariance of the tracked parameters over all hypotheses.
    findings : tuple of Finding
        Detected jumps. A jump may be attributed to another parameter for up to 2.6 time scales
        after its onset.
    alarm : bool
        Whether a jump was detected in the last sample.
    learnt : dict of str to (float, float)
        Value and standard deviation of all parameters.
    beliefs : dict of str to float
        Probability that each parameter has jumped within the time that the bank covers.
    hypotheses : dict of str to (H, 3) array
        The hypotheses for each parameter, the latest first: samples since the jump, probability,
        and size.
    fixed_because : dict of str to str
        Parameters that were not learnt, with the reason.
    cogging : int
        Number of cogging waves per turn that were found; 0 for none.
    """

    def __init__(
        self,
        design: Design,
        *,
        tracked: int,
        jumps: Jumps,
        timing: Timing,
        told: Sequence[Mapping[str, float]],
        fixable: Mapping[str, str],
        shapes: Mapping[tuple[str, ...], tuple[str, ...]],
        waves: int = 0,
        angle: int = 0,
        torque_noise: Mapping[str, float],
        richer: "Glr | None" = None,
    ) -> None:
        names = design.model.names
        super().__init__(names[:tracked], design.output)
        values = {
            names.index(name): value / design.scale[names.index(name)]
            for group in told
            for name, value in group.items()
        }
        groups = [[names.index(name) for name in group] for group in told if group]
        arrays = joint_arrays(design, rests=True, **torque_noise)
        arrays["drift"] = np.diag(jumps.walk)
        bank = bank_of(
            design,
            jumps,
            timing,
            alarm=ALARM,
            groups=[(g, [values[i] for i in g]) for g in groups],
            tracked=tracked,
            waves=waves,
        )
        at = {
            tuple(names.index(n) for n in levels): tuple(names.index(n) for n in of)
            for levels, of in shapes.items()
        }
        states = Memory(arrays, times=2)
        self._plain = Workspace(
            design, jumps, timing, tracked, values, dict(fixable), at, angle, states, bank, states
        )
        self._rich = richer._plain if richer else None
        self.reset()
        self.run([], [])  # what it compiles it compiles now, not in the first step

    def _start(self) -> None:
        self._before: list[Finding] = []
        self._begin_at(0, self._plain.fresh())

    def _begin_at(self, origin: int, work: Workspace) -> None:
        """Prepare for the first sample, or for a repeated pass over the initialisation data."""
        # together, as a copy copies them
        self._parts = work, Comparison(work, origin), FirstSeconds(work)
        self._origin, self.alarm = origin, False
        self.fixed_because: dict[str, str] = {}
        self.cogging = 0
        if work.timing.first == 0:
            work.bank["awake"] = 1

    @property
    def _work(self) -> Workspace:
        return self._parts[0]

    @property
    def _comparison(self) -> Comparison:
        return self._parts[1]

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._work.mean()[0][: len(self.names)]

    @property
    def covariance(self) -> Array:  # noqa: D102
        p = len(self.names)
        return self._work.mean()[1][:p, :p]

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return (*self._before, *self._comparison.findings)

    @property
    def learnt(self) -> dict[str, tuple[float, float]]:  # noqa: D102
        theta, P = self._work.mean()
        pairs = zip(theta.tolist(), np.sqrt(np.maximum(np.diag(P), 0)).tolist(), strict=True)
        return dict(zip(self._work.names, pairs, strict=True))

    @property
    def beliefs(self) -> dict[str, float]:  # noqa: D102
        return self._work.beliefs()

    @property
    def hypotheses(self) -> dict[str, Array]:  # noqa: D102
        return self._work.hypotheses()

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done, running = 0, True
        while running:
            rest, work = slice(done, None), self._work
            samples = u[rest], y[rest], valid[rest], estimates[rest], trace[rest]
            self.alarm = self.alarm and not len(samples[0])
            states, bank = work.states, work.bank
            done += glr(states.block, states.at, bank.block, bank.at, *samples)
            self._attend()
            if done and not np.isfinite(estimates[done - 1]).all():  # it has just begun anew
                estimates[done - 1] = self._work.states["theta"][0, : len(self.names)]
            work = self._work
            running = done < len(u) or (work.busy and bool(work.bank["left"] > 0))
        estimates *= self._plain.design.scale[: len(self.names)]

    def _attend(self) -> None:
        """Do what is due after a sample, now or when the budget of a later sample allows it."""
        work, bank = self._work, self._work.bank
        cost = int(work.timing.budget * (COMPARING if bank["awake"] else LEARNING))
        if work.states["anew"][0] > 0:
            self._begin_anew()
        elif not (work.caught_up if work.busy else bank["asks"]):
            return
        elif bank["left"] < cost:
            bank["left"] = 0
        else:
            bank["left"] -= cost
            self._decide()

    def _decide(self) -> None:
        """Evaluate a pass that has ended, or start the next one."""
        work, bank, learning = self._work, self._work.bank, self._parts[2]
        if not bank["awake"]:
            if work.busy:
                learning.go_on()
            elif not self._take_up_cogging():  # else that is enough for one sample
                self.fixed_because = learning.begin()
        elif work.busy:
            self.alarm = self._comparison.go_on()
        elif 0 <= bank["due"] <= work.now:
            self._comparison.review()
        else:
            self._comparison.begin()

    def _take_up_cogging(self) -> bool:
        """Continue with the filter that has a cogging law if the initialisation data show it."""
        work, rich, wave = self._work, self._rich, None
        if rich and work.bank["searching"]:
            variance = float(rich.design.scale[-2]) ** 2
            wave = strongest_wave(work.bank, variance)
        if rich and wave:
            richer = rich.fresh()
            take_up(work, richer, wave)
            self._begin_at(self._origin, richer)
            self.cogging = wave[0]
        self._work.bank["searching"] = 0
        return wave is not None

    def _begin_anew(self) -> None:
        """Let the state recover after a stuck sensor; reset the filter if it is lost."""
        work, p = self._work, self._work.p
        P, begin = work.states["P"][0], work.begin["P"][0]
        if work.states["anew"][0] < 2 and work.bank["awake"]:
            P[:, p:] = P[p:] = 0.0
            P[p:, p:] = begin[p:, p:]
            work.states["anew"][0] = 0.0
            self._comparison.forget()
            work.empty()
            return
        begin_anew(work.states, work.begin)
        numbers, taken = work.states["now"].copy(), int(work.bank["taken"])
        self._before = list(self.findings)
        self._begin_at(self._origin + taken, self._plain.fresh())
        self._work.states["now"] = numbers
