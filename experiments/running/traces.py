"""What trajectories are drawn from: a file a unit of work, beside the rows.

A run's figures need a point in ten of every estimate, all estimates and the error after the fault,
and the residual; kept in memory they would be most of what a run takes. They are written before the
rows of their cases, so that a case that has rows has them.
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
from flexaxis.experiments.scoring.curves import Detail
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
    detail : Detail or None
        What else there is of it; None in folders of versions that did not keep it.
    """

    case: str
    hash: str
    estimator: str
    names: tuple[str, ...]
    curve: Array
    relative: Mapping[str, Array]
    detail: Detail | None = None


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
    meta, arrays = [], dict[str, NDArray[Any]]()
    for number, ((key, estimator), group) in enumerate(groups.items()):
        first = group[0]
        told = {"hash": key, "estimator": estimator, "names": first.names}
        told |= {"cases": [t.case for t in group], "changed": list(first.relative)}
        meta.append(told | _kept(group, str(number), arrays))
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


def _kept(
    group: Sequence[Trace], number: str, arrays: dict[str, NDArray[Any]]
) -> dict[str, list[Any]]:
    """Put the details of some runs into arrays, and return their findings and who has a residual.

    Those with a residual are numbered: an estimator need not show it in every run.
    """
    details = [trace.detail for trace in group]
    known = [detail for detail in details if detail is not None]
    if len(known) < len(group):
        return {}
    residuals = {i: d.residual for i, d in enumerate(known) if d.residual is not None}
    arrays[f"{number}.near"] = np.stack([detail.near for detail in known])
    if residuals:
        arrays[f"{number}.residual"] = np.stack(list(residuals.values()))
    return {"findings": [list(detail.findings) for detail in known], "shown": list(residuals)}


def _details(stored: Any, number: int, told: Mapping[str, Any]) -> list[Detail | None]:
    """Return the details of some runs from a file."""
    if "findings" not in told:
        return [None] * len(told["cases"])
    near = stored[f"{number}.near"]
    found = dict(
        zip(told["shown"], stored[f"{number}.residual"] if told["shown"] else (), strict=True)
    )
    return [
        Detail(near[i], found.get(i), tuple(findings))
        for i, findings in enumerate(told["findings"])
    ]


def trace_files(folder: Path) -> list[Path]:
    """Return the files of traces in the folder of a run."""
    return sorted((folder / TRACES).glob("[!.]*.npz"))


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
                details = _details(stored, number, told)
            for i, case in enumerate(told["cases"]):
                each = {name: errors[i] for name, errors in relative.items()}
                found[case] = Trace(
                    case, key, estimator, tuple(told["names"]), curves[i], each, details[i]
                )
        return [found[case] for case in sorted(found)]
