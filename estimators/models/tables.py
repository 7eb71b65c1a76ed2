"""Models from tables, such as those of a TOML."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.model import Model

_KEYS = ("name", "states", "A", "B", "C", "nominal")
_LAW_KEYS = ("kind", "drive", "acts", "parameters")


def model_from_tables(tables: Mapping[str, Any]) -> Model:
    """
    Return a model from nested tables, as `tomllib` reads them.

    Parameters
    ----------
    tables : mapping
        Either ``model``, the name of a shipped one, or its own ``name``, ``states``, ``A`` (rows
        of formulas), ``B`` and ``C``; and ``nominal``, the value of each parameter [SI]. To either
        ``law``, a list of tables with ``kind``, ``drive``, ``acts`` and ``parameters``, adds
        nonlinear laws as `flexaxis.estimators.models.laws.Law` has them. Other keys are left to
        the caller.

    Raises
    ------
    EstimatorError
        If a key is missing or of the wrong kind, a formula cannot be read, or a value is missing.

    Examples
    --------
    >>> model_from_tables({"model": "one_mass", "nominal": {"k_T": 1, "J_m": 2, "f_m": 3}}).states
    ('speed_motor',)
    >>> model_from_tables({
    ...     "model": "one_mass",
    ...     "nominal": {"k_T": 1, "J_m": 2, "f_m": 3, "f_c": 0.1},
    ...     "law": [{
    ...         "kind": "static",
    ...         "drive": {"speed_motor": 1},
    ...         "acts": {"speed_motor": "-1/J_m"},
    ...         "parameters": {"coulomb": "f_c", "beta": 20},
    ...     }],
    ... }).parameters
    ('k_T', 'J_m', 'f_m', 'f_c')
    """
    laws = tables.get("law", [])
    for i, table in enumerate(laws if isinstance(laws, list) else ()):
        for key in table:
            if key not in _LAW_KEYS:
                raise EstimatorError(f"law[{i}].{key}: {did_you_mean(str(key), _LAW_KEYS)}")
    laws = _checked("law", list[Law], laws)
    if "model" in tables:
        name = str(tables["model"])
        if name not in MODELS:
            raise EstimatorError(f"unknown model {name!r}: {did_you_mean(name, MODELS)}")
        nominal = _checked("nominal", dict[str, float], tables.get("nominal", {}))
        model = MODELS[name].factory(nominal)
    else:
        if missing := [key for key in _KEYS if key not in tables]:
            raise EstimatorError(
                f"the model has no {', '.join(missing)}; give {', '.join(_KEYS)}, or name a "
                f'shipped model with model = "…": {", ".join(MODELS)}'
            )
        model = _checked("model", Model, {key: tables[key] for key in _KEYS})
    return replace(model, laws=(*model.laws, *laws)) if laws else model


def _checked(key: str, kind: Any, value: Any) -> Any:
    """Return a table as what it stands for; raise EstimatorError at what does not fit."""
    from pydantic import TypeAdapter, ValidationError  # takes longer to import than all else here

    try:
        return TypeAdapter(kind).validate_python(value)
    except ValidationError as error:
        wrong = (
            f"{'.'.join(map(str, (key, *e['loc'])))}: {e['msg'].removeprefix('Value error, ')}"
            for e in error.errors()
        )
        raise EstimatorError("; ".join(wrong)) from None
