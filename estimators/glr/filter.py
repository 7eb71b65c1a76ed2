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
from flexaxis.estimators.glr.mixture import beliefs, hypotheses, mean
from flexaxis.estimators.glr.records import Jumps, Timing, bank_of
from flexaxis.estimators.glr.workspace import Kit, Workspace, take_up
from flexaxis.estimators.models.axes import COGGING
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.protocol import Finding

Array = NDArray[np.float64]


class Glr(RecursiveEstimator):
    """
    A joint Kalman filter with a bank of hypotheses that learns structure in the first seconds.

    Parameters
    ----------
    design : Design
        Tracked parameters first, those that are learnt once after them.
    tracked : int
        Number of the tracked ones, the estimates.
    jumps : Jumps
    timing : Timing
    told : sequence of mapping of str to float
        Groups of parameters with the values to which estimates are drawn where the data do not
        contradict, see `flexaxis.estimators.filters.constrained`.
    fixable : mapping of str to str
        What of these is fixed where it is not seen, and how `fixed_because` says so.
    shapes : mapping of tuple of str to tuple of str
        Levels of dry friction, and what shapes it where one of these is not zero.
    waves : int
        In a turn, of the fastest cogging that is looked for; 0 for none.
    angle : int
        Which state is the angle of the motor, or would be.
    richer : Glr, optional
        One that has a law of cogging as its last law, and goes on where cogging is found.

    Attributes
    ----------
    theta, covariance
        Mean and covariance of the tracked parameters over all hypotheses.
    findings : tuple of Finding
        What was found; a name may give way to another one for 2.6 time scales after its onset.
    alarm : bool
        Whether something was found in the last sample.
    learnt : dict of str to (float, float)
        All parameters with value and standard deviation.
    beliefs : dict of str to float
        Probability that each parameter has jumped within the time that the bank covers.
    hypotheses : dict of str to (H, 3) array
        The bank as it stands, by the parameter that jumped: how many samples ago, with which
        probability, and by how much; the latest first.
    fixed_because : dict of str to str
        Parameters that were not learnt, and why not.
    cogging : int
        Waves in a turn of cogging that was found, though nobody told; 0 for none.
    """

    _shared = (*RecursiveEstimator._shared, "_kit", "_plain", "_rich")

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
        richer: "Glr | None" = None,
    ) -> None:
        names = design.model.names
        lower, upper = design.bounds
        super().__init__(names[:tracked], design.output, (lower[:tracked], upper[:tracked]))
        values = {
            names.index(name): value / design.scale[names.index(name)]
            for group in told
            for name, value in group.items()
        }
        groups = [[names.index(name) for name in group] for group in told if group]
        arrays = joint_arrays(design, rests=True)
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
        self._plain = Kit(design, jumps, timing, values, dict(fixable), at, states, bank, angle)
        self._rich = richer._plain if richer else None
        self.reset()
        self.run([], [])  # what it compiles it compiles now, not in the first step

    def _start(self) -> None:
        self._before: list[Finding] = []
        self._kit = self._plain
        self._begin_at(0, self._kit.begin())

    def _begin_at(self, origin: int, work: Workspace) -> None:
        """Be about to take the first sample, or to go through the first seconds again."""
        first = FirstSeconds(
            work, len(self.names), self._kit.told, self._kit.fixable, self._kit.shapes
        )
        self._parts = work, Comparison(work, origin), first  # together, as a copy copies them
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
        return mean(self._work)[0][: len(self.names)]

    @property
    def covariance(self) -> Array:  # noqa: D102
        p = len(self.names)
        return mean(self._work)[1][:p, :p]

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return (*self._before, *self._comparison.findings)

    @property
    def learnt(self) -> dict[str, tuple[float, float]]:  # noqa: D102
        return self._named(*mean(self._work))

    @property
    def beliefs(self) -> dict[str, float]:  # noqa: D102
        return beliefs(self._work)

    @property
    def hypotheses(self) -> dict[str, Array]:  # noqa: D102
        return hypotheses(self._work)

    def _named(self, theta: Array, P: Array) -> dict[str, tuple[float, float]]:
        """Return value and standard deviation by name."""
        pairs = zip(theta.tolist(), np.sqrt(np.maximum(np.diag(P), 0)).tolist(), strict=True)
        return dict(zip(self._work.names, pairs, strict=True))

    def commissioned(self) -> dict[str, dict[str, float]]:
        """
        Return what is known of the axis now, from which another estimator may begin.

        Returns
        -------
        dict
            ``nominal``: values of physical parameters; ``deviations``: their standard deviations.
            What was fixed is not among them, nor cogging that was found; they are those of the
            data, not drawn to what was told.
        """
        scale, p = self._work.design.scale, self._work.p
        states, cogging = self._work.states, COGGING.names if self.cogging else ()
        all_of = self._named(
            states["theta"][0] * scale, states["P"][0, :p, :p] * np.outer(scale, scale)
        )
        found: dict[str, dict[str, float]] = {"nominal": {}, "deviations": {}}
        for name, (value, deviation) in all_of.items():
            if name in self.fixed_because or name in cogging:
                continue
            inverse = name.startswith("1/")
            physical = name.removeprefix("1/")
            found["nominal"][physical] = 1 / value if inverse else value
            found["deviations"][physical] = deviation / value**2 if inverse else deviation
        return found

    def __deepcopy__(self, memo: object) -> "Glr":
        return self.copy()

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done, running = 0, True
        while running:
            rest, work = slice(done, None), self._work
            given = u[rest], y[rest], valid[rest], estimates[rest], trace[rest]
            self.alarm = self.alarm and not len(given[0])
            states, bank = work.states, work.bank
            done += glr(states.block, states.at, bank.block, bank.at, *given)
            self._attend()
            if done and not np.isfinite(estimates[done - 1]).all():  # it has just begun anew
                estimates[done - 1] = self._work.states["theta"][0, : len(self.names)]
            work = self._work
            running = done < len(u) or (work.busy and bool(work.bank["left"] > 0))
        estimates *= self._plain.design.scale[: len(self.names)]

    def _attend(self) -> None:
        """Do what is due after a sample."""
        work, bank = self._work, self._work.bank
        if work.states["anew"][0] > 0:
            self._begin_anew()
        elif work.caught_up and not bank["awake"]:
            self._parts[2].go_on()
        elif work.caught_up:
            self.alarm = self._comparison.go_on()
        elif work.busy or not bank["asks"]:
            return
        elif not bank["awake"]:
            if not self._take_up_cogging():  # else that is enough for one sample
                self.fixed_because = self._parts[2].begin()
        elif 0 <= bank["due"] <= work.now:
            self._comparison.review()
        else:
            self._comparison.begin()

    def _take_up_cogging(self) -> bool:
        """Go on with a filter that knows of cogging if the first seconds show it."""
        work, rich, wave = self._work, self._rich, None
        if rich and work.bank["searching"]:
            variance = float(rich.design.scale[-2]) ** 2
            wave = strongest_wave(work.bank, variance)
        if rich and wave:
            richer = rich.begin()
            take_up(work, richer, wave)
            self._kit = rich
            self._begin_at(self._origin, richer)
            self.cogging = wave[0]
        self._work.bank["searching"] = 0
        return wave is not None

    def _begin_anew(self) -> None:
        """Wait for the state after a sensor that did not follow; begin anew if all is lost."""
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
        self._before, self._kit = list(self.findings), self._plain
        self._begin_at(self._origin + taken, self._plain.begin())
        self._work.states["now"] = numbers
