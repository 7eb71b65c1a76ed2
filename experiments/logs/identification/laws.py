"""What a log asks for beside its linear model: that with which it is simulated better elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.inverse import Inverse
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.candidates import (
    LINEAR,
    better,
    errors_of,
    explain,
    held_out,
    over_pieces,
    tried,
)
from flexaxis.experiments.logs.identification.friction import KINDS, Asked, able, beside, rubbing
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.identification.starts import Starts, explored
from flexaxis.experiments.logs.spectra import corner_below

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SURE = 3.0  # standard deviations of a law's level, below which it is dropped
CERTAIN = 5.0  # of a regressor of the inverse dynamics, from which on it is tried
MOVES = 0.01  # part of the unexplained torque that it takes away at the least
SIDED, GRAVITY = ("f_sided",), ("g_sin", "g_cos")
TURN = 0.5  # rad of the load, below which gravity is about a constant
MOST = 0.5  # of the variance that a simulation leaves, that lies below the excitation
EARLIEST = 0.02  # samples: less delay than that is the least of a held torque


@dataclass(frozen=True)
class Tried:
    """Something that was compared with less.

    Attributes
    ----------
    name : str
        In words.
    before, after : float
        Standard deviations of the error of a simulation of held-out pieces, without and with it.
    taken : bool
    """

    name: str
    before: float
    after: float
    taken: bool


@dataclass(frozen=True)
class Chosen:
    """What is fitted to a log.

    Attributes
    ----------
    setup : Setup
    parts : mapping of str to Fitted
        Fits to what is not held out, as of `candidates.tried`.
    held : ndarray (N,) of bool
    tried : tuple of Tried
    """

    setup: Setup
    parts: Mapping[str, Fitted]
    held: Flags
    tried: tuple[Tried, ...] = ()

    @property
    def best(self) -> Fitted:
        """The fit that best simulates what was held out."""
        return min(self.parts.values(), key=lambda part: float(np.mean(self._of(part))))

    @property
    def z(self) -> Array:
        """Its unknowns (q,)."""
        return self.best.z

    def errors(self, highpass: float | None = None) -> Array:
        """Return mean squares of its simulation of what was held out, in parts."""
        return errors_of(self.setup, self.best, self.held, highpass)

    def _of(self, part: Fitted) -> Array:
        return errors_of(self.setup, part, self.held)

    def sure(self, names: Sequence[str]) -> bool:
        """Return whether some parameter or gain is one beyond its deviations; if fixed, it is."""
        own = (*self.setup.names, *self.setup.beside)
        places = [own.index(name) for name in names if name in own]
        deviations = np.maximum(self.best.deviations, over_pieces(self.best))[places]
        return not places or bool((abs(self.z[places]) > SURE * deviations).any())

    def against(
        self, other: Chosen, name: str, of: Sequence[str] = (), highpass: float | None = None
    ) -> Chosen:
        """Return the other where it simulates better and is `sure`, else this; with a remark."""
        before, after = self.errors(highpass), other.errors(highpass)
        taken = other.sure(of) and better(before, after)
        told = Tried(name, _rms(before), _rms(after), taken)
        return replace(other if taken else self, tried=(*self.tried, told))


def _rms(squares: Array) -> float:
    return float(np.sqrt(np.mean(squares)))


def check_given(model: Model, asked: Asked) -> None:
    """Refuse values of parameters that no law has which is looked for.

    Raises
    ------
    LogError
    """
    wanted = "coulomb" if asked.friction == "auto" else asked.friction
    fits = asked.given.keys() <= {*KINDS.get(wanted, {}).values()}
    if asked.given and (model.laws or not fits):
        have = "; ".join(f"{k} has {', '.join(sorted(KINDS[k].values()))}" for k in KINDS)
        whose = "the axis, with laws of its own," if model.laws else f"--friction {asked.friction}"
        raise LogError(f"{whose} has no {', '.join(asked.given)}; of --friction, {have}")


def chosen(starts: Starts, asked: Asked) -> Chosen:
    """Return what a log asks for, or what somebody stated."""
    bench = _Bench(starts, asked)
    found = bench.searched(starts.setup)
    log = starts.setup.log
    corner = corner_below(log.u[log.ok], period=log.period)
    if starts.setup.highpass is None and corner is not None and _drifts(found, corner):
        other = bench.searched(replace(starts.setup, highpass=corner))
        found = found.against(other, f"residuals above {corner:g} Hz only", highpass=corner)
    early = found.z[-1] <= EARLIEST * log.period and starts.setup.delay is None
    if asked.told or log.smooth or not early:
        return found
    smooth = replace(starts.setup, log=log.smoothed(), highpass=found.setup.highpass)
    return found.against(bench.searched(smooth), "a torque that is smooth between samples")


def _drifts(found: Chosen, corner: float) -> bool:
    """Return whether most of what a simulation leaves lies below a corner [Hz]."""
    return float(np.mean(found.errors(corner))) < (1 - MOST) * float(np.mean(found.errors()))


@dataclass(frozen=True)
class _Bench:
    starts: Starts
    asked: Asked

    def searched(self, setup: Setup) -> Chosen:
        """Return what the log asks for with this kind of torque."""
        seen, kind = self._seen(setup), self.asked.friction
        if kind in KINDS and not setup.model.laws:
            setup = beside(setup, GRAVITY) if self.asked.gravity == "sine" else setup
            return self._sided(self._rubbing(setup, None, kind), seen)
        found = self._falling(self._fitted(setup), seen)
        if setup.model.laws or not able(setup.model):
            return self._sided(found, seen)
        rubs = self._rubbing(found.setup, found, "coulomb")
        if self.asked.given:  # whoever gives its value says that it is there
            return replace(rubs, tried=found.tried)
        other = found.against(rubs, "dry friction (Coulomb)", ("f_c",))
        return replace(found, tried=other.tried) if kind == "none" else self._sided(other, seen)

    def _seen(self, setup: Setup) -> Inverse | None:
        log = setup.log
        turns = self.asked.gravity == "auto" and float(np.ptp(log.angle[log.ok])) > TURN
        names = [*LINEAR, "sided", *(("sine", "cosine") if turns else ())]
        return explain(log, 0.0, names) if setup.highpass is None and able(setup.model) else None

    def _falling(self, found: Chosen, seen: Inverse | None) -> Chosen:
        """Return it with gravity where that is asked for, or simulates better."""
        sine = self.asked.gravity == "sine"
        if not sine and not _worth(seen, ("sine", "cosine")):
            return found
        other = self._fitted(beside(found.setup, GRAVITY))
        return (
            other
            if sine
            else found.against(other, "a torque by the angle, such as gravity", GRAVITY)
        )

    def _sided(self, found: Chosen, seen: Inverse | None) -> Chosen:
        """Return it with friction that has two sides where that simulates better."""
        if not _worth(seen, ("sided",)):
            return found
        setup = beside(found.setup, (*found.setup.beside, *SIDED))
        z = np.insert(found.z, len(setup.names) + len(found.setup.beside), 0.0)
        return found.against(self._tried(setup, z), "friction with two sides", SIDED)

    def _fitted(self, setup: Setup) -> Chosen:
        return self._tried(setup, self.starts.search(setup).z)

    def _tried(self, setup: Setup, z: Array) -> Chosen:
        held = held_out(setup)
        return Chosen(setup, tried(setup, z, held), held)

    def _rubbing(self, setup: Setup, plain: Chosen | None, kind: str) -> Chosen:
        """Return the setup with a law, from where it fits without, or without anything."""
        level, asked, lag = self.starts.dry[0], self.asked, 0.0
        if "f_c" in asked.given:
            level = asked.given["f_c"] / float(setup.model.nominal.get("k_T", 1.0))
        if plain is not None:
            values, lag = plain.z[: len(setup.names)].tolist(), float(plain.z[-1])
            setup = setup.having(dict(zip(setup.names, values, strict=True)))
        grown = rubbing(setup, kind, level, asked)
        theta = grown.model.parametrize(grown.names).theta
        places = [(theta, lag), *self.starts.places(grown, level)]
        return self._tried(grown, explored(grown, places, self.starts.ladder(grown, level)).z)


def _worth(seen: Inverse | None, names: Sequence[str]) -> bool:
    """Return whether the inverse dynamics say that regressors may be there."""
    if seen is None or not all(name in seen.value for name in names):
        return False
    return max(map(seen.sure, names)) > CERTAIN and seen.gain(names) > MOVES
