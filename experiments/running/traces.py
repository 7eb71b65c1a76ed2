"""What trajectories are drawn from: a file a unit of work, beside the rows.

A run's figures need a point in ten of every estimate, and the error after the fault; kept in
memory they would be most of what a run takes. They are written before the rows of their cases, so
that a case that has rows has them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.running.files import OutputError, writing
from flexaxis.sim.files import atomic

TRACES = "traces"
Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Trace:
    """The trajectory of a case.

    Attributes
    ----------
    case, hash, estimator : str
    names : tuple of str
        Estimated parameters.
    curve : ndarray (M, p)
        Every tenth estimate over its nominal value.
    relative : dict of str to ndarray (n,)
        θ̃/D in the first scored window of each changed parameter.
    """

    case: str
    hash: str
    estimator: str
    names: tuple[str, ...]
    curve: Array
    relative: Mapping[str, Array]


def write_traces(folder: Path, traces: Sequence[Trace]) -> None:
    """Write the traces of a unit to a file of its own.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    if not traces:
        return
    groups: dict[tuple[str, str], list[Trace]] = {}
    for trace in traces:
        groups.setdefault((trace.hash, trace.estimator), []).append(trace)
    meta, arrays = [], {}
    for number, ((key, estimator), group) in enumerate(groups.items()):
        first = group[0]
        told = {"hash": key, "estimator": estimator, "names": first.names}
        meta.append(told | {"cases": [t.case for t in group], "changed": list(first.relative)})
        arrays[f"{number}.curve"] = np.stack([trace.curve for trace in group])
        for name in first.relative:
            arrays[f"{number}.{name}"] = np.stack([trace.relative[name] for trace in group])
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)  # type: ignore[arg-type]
    name = sha256(" ".join(trace.case for trace in traces).encode()).hexdigest()[:16]
    target = folder / TRACES / f"{name}.npz"
    with writing(target):
        target.parent.mkdir(exist_ok=True)
        with atomic(target) as part:
            part.write_bytes(buffer.getvalue())


def trace_files(folder: Path) -> list[Path]:
    """Return the files of traces in the folder of a run."""
    # a hidden one is what a kill has left of a file
    found = (folder / TRACES).glob("*.npz")
    return sorted(path for path in found if not path.name.startswith("."))


@dataclass(frozen=True)
class Traces:
    """All traces of a folder; read when they are asked for.

    Attributes
    ----------
    places : dict
        Files with traces of an estimator (by its text) on a scenario (by its hash), and where in
        the file.
    """

    places: Mapping[tuple[str, str], list[tuple[Path, int, dict[str, Any]]]] = field(
        default_factory=dict
    )

    @classmethod
    def of(cls, folder: Path) -> Traces:
        """Return the traces in the folder of a run.

        Raises
        ------
        OutputError
            If a file is damaged.
        """
        places: dict[tuple[str, str], list[tuple[Path, int, dict[str, Any]]]] = {}
        for path in trace_files(folder):
            try:
                with np.load(path, allow_pickle=False) as stored:
                    told = json.loads(str(stored["meta"]))
            except Exception as error:  # a damaged file fails in many ways
                raise OutputError(
                    f"{path} is damaged: remove it; the figures are then drawn without its runs"
                ) from error
            for number, each in enumerate(told):
                key = each["hash"], each["estimator"]
                places.setdefault(key, []).append((path, number, each))
        return cls(places)

    def find(self, key: str, estimator: str) -> list[Trace]:
        """Return the traces of an estimator on a scenario, each case once, in their order.

        Parameters
        ----------
        key : str
            Hash of the scenario.
        estimator : str
        """
        found = dict[str, Trace]()
        for path, number, told in self.places.get((key, estimator), []):
            with np.load(path, allow_pickle=False) as stored:
                curves = stored[f"{number}.curve"]
                relative = {name: stored[f"{number}.{name}"] for name in told["changed"]}
            for i, case in enumerate(told["cases"]):
                each = {name: errors[i] for name, errors in relative.items()}
                found[case] = Trace(case, key, estimator, tuple(told["names"]), curves[i], each)
        return [found[case] for case in sorted(found)]
