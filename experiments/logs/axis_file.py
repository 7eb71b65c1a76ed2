"""Read and write axis files, with a model, nominal values, a delay and a whitening filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, InstanceOf

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import MODELS, model_from_tables
from flexaxis.estimators.models.model import Model
from flexaxis.experiments.files import write_text
from flexaxis.experiments.logs.findings import LogError, checked
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.record import Record
from flexaxis.sim.text_files import read_toml, toml_text

_MODEL = ("model", "name", "states", "A", "B", "C", "law", "nominal")
SAME_RATE = 0.01  # maximum relative difference between two sampling rates that count as equal


class Axis(BaseModel):
    """The model of an axis, and the results of its identification from a log.

    Attributes
    ----------
    model : Model
        Model with nominal values.
    tables : dict
        Those tables of the TOML file that define the model.
    known : bool
        True if the nominal values are given or identified, False if they are a rough guess.
    delay : float
        Delay of the torque [s].
    offset : float
        Constant additional torque, in the unit of the logged torque.
    noise : float or None
        Standard deviation of the whitened residuals [rad/s], or None if it is unknown.
    error : float or None
        Rms simulation error in held-out pieces of the log [rad/s], or None if it is unknown.
    rate : float or None
        Sampling rate [Hz] of the log from which the axis was identified, or None if it is unknown.
        The whitening filter and the noise are valid only for this rate.
    whitening : tuple of float
        Coefficients of the filter that makes the residuals white. The default (1,) means no filter.
    deviation : dict of str to float
        Standard deviations of the nominal values, where known.
    beside : dict of str to float
        Gains of the gravity torque, in the unit of the logged torque. The gain `g_sin` multiplies
        −sin φ and the gain `g_cos` multiplies −cos φ, where φ is the load angle.
    problems : list of str
        Reasons why the identified values cannot be used.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    model: InstanceOf[Model]
    tables: dict[str, Any]
    known: bool
    delay: float = 0.0
    offset: float = 0.0
    noise: float | None = None
    error: float | None = None
    rate: float | None = None
    whitening: tuple[float, ...] = Field((1.0,), strict=False)
    deviation: dict[str, float] = {}
    beside: dict[Literal["g_sin", "g_cos"], float] = {}
    problems: list[str] = []

    def having(self, values: Mapping[str, float]) -> Axis:
        """Return a copy of the axis with some nominal values replaced."""
        for name in values:
            if name not in self.model.parameters:
                raise LogError(
                    f"model {self.model.name} has no parameter {name!r}."
                    f"{did_you_mean(name, self.model.parameters)} The parameters are "
                    f"{', '.join(self.model.parameters)}"
                )
        nominal = dict(self.model.nominal) | dict(values)
        return self.model_copy(update={"model": replace(self.model, nominal=nominal)})

    def check_rate(self, period: float) -> None:
        """Reject a log whose sampling rate differs from that of the whitening filter.

        Raises
        ------
        LogError
            If the rates differ, or if the nominal values of the axis are only a rough guess.
        """
        if not self.known:
            raise LogError(
                f"model {self.model.name} has no nominal values. Use the axis file that `flexaxis "
                "identify` writes"
            )
        if self.rate is not None and abs(self.rate * period - 1) > SAME_RATE:
            raise LogError(
                f"the axis was identified at {self.rate:.6g} Hz, and its whitening filter is valid "
                f"only for this rate. The sampling rate of the log is {1 / period:.6g} Hz. Import "
                f"the log with --resample {self.rate:.6g}, or identify the axis again from this log"
            )

    def save(self, path: Path) -> None:
        """Write the axis to a TOML file."""
        results = self.model_dump(exclude={"model", "tables", "known"}, exclude_defaults=True)
        content = self.tables | {"nominal": dict(self.model.nominal)} | results
        if self.model.laws:
            content["law"] = [vars(law) for law in self.model.laws]
        write_text(path, f"# written by flexaxis\n{toml_text(content)}")


def find_axis(text: str) -> Axis:
    """Return the axis of a built-in model, or the axis that a TOML file describes.

    Raises
    ------
    LogError
        If the model or the file does not exist, or if the file contains an error.
    """
    if text in MODELS:
        shipped = MODELS[text]
        model = shipped.factory(shipped.rough)
        return Axis(model=model, tables={"model": text}, known=False)
    path = Path(text)
    if path.suffix != ".toml":
        raise LogError(
            f"unknown model {text!r}.{did_you_mean(text, MODELS)} The built-in models are "
            f"{', '.join(MODELS)}. For your own model, give the path of a .toml file"
        )
    tables = read_toml(path, LogError)
    kept = {key: tables[key] for key in _MODEL if key in tables}
    own = {key: tables[key] for key in tables if key not in kept}
    try:
        given = {"model": model_from_tables(tables), "tables": kept, "known": True}
    except EstimatorError as error:
        raise LogError(f"{path}: {error}") from error
    return checked(Axis, own | given, path)


def valid_of(record: Record) -> NDArray[np.bool_]:
    """Return a mask (N,) of the samples of a record that have a valid output."""
    return np.ones(len(record.time), bool) if record.valid is None else record.valid


def usable(record: Record) -> NDArray[np.bool_]:
    """Return a mask (N,) of the samples after the burn-in that have a valid output."""
    return valid_of(record) & (record.time - record.time[0] >= record.burn_in)


def output_of(record: Record) -> tuple[str, NDArray[np.float64]]:
    """Return the name and the values (N,) of the output: the increment if any, else the speed."""
    if record.increment is None:
        return "speed", np.asarray(record.speed)
    return "increment", record.increment
