"""A user's own linear grey-box model from tables, such as those of a TOML."""

from collections.abc import Mapping
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import Model

_KEYS = ("name", "states", "A", "B", "C", "nominal")


def model_from_tables(tables: Mapping[str, Any]) -> Model:
    """
    Return a model from nested tables, as `tomllib` reads them.

    Parameters
    ----------
    tables : mapping
        Either ``model``, the name of a shipped one, or its own ``name``, ``states``, ``A`` (rows
        of formulas), ``B`` and ``C``; and ``nominal``, the value of each parameter [SI]. Other
        keys are left to the caller.

    Raises
    ------
    EstimatorError
        If a key is missing or of the wrong kind, a formula cannot be read, or a value is missing.

    Examples
    --------
    >>> model_from_tables({"model": "one_mass", "nominal": {"k_T": 1, "J_m": 2, "f_m": 3}}).states
    ('speed_motor',)
    """
    nominal = tables.get("nominal", {})
    if not isinstance(nominal, Mapping) or not all(_is_number(v) for v in nominal.values()):
        raise EstimatorError("nominal must be a table of numbers, such as nominal.J_m = 1.2e-3")
    if "model" in tables:
        name = str(tables["model"])
        if name not in MODELS:
            raise EstimatorError(f"unknown model {name!r}: {did_you_mean(name, MODELS)}")
        return MODELS[name].factory(nominal)
    missing = [key for key in _KEYS if key not in tables]
    if missing:
        raise EstimatorError(
            f"the model has no {', '.join(missing)}; give {', '.join(_KEYS)}, or name a shipped "
            f'model with model = "…": {", ".join(MODELS)}'
        )
    try:
        return Model(
            name=str(tables["name"]),
            states=tuple(map(str, tables["states"])),
            A=tuple(tuple(map(str, row)) for row in tables["A"]),
            B=tuple(map(str, tables["B"])),
            C=tuple(map(str, tables["C"])),
            nominal={name: float(value) for name, value in nominal.items()},
        )
    except TypeError as error:
        raise EstimatorError(
            'A takes rows of formulas, A = [["0", "1"], ["-k/J_m", "-d/J_m"]]; states, B and C '
            'take one text for each state, B = ["0", "k_T/J_m"]'
        ) from error


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
