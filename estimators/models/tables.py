"""Models from tables, such as those of a TOML."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.laws import LAWS, Law
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
    nominal = tables.get("nominal", {})
    if not isinstance(nominal, Mapping) or not all(_is_number(v) for v in nominal.values()):
        raise EstimatorError("nominal must be a table of numbers, such as nominal.J_m = 1.2e-3")
    if "model" in tables:
        name = str(tables["model"])
        if name not in MODELS:
            raise EstimatorError(f"unknown model {name!r}: {did_you_mean(name, MODELS)}")
        return _with_laws(MODELS[name].factory(nominal), tables.get("law", []))
    missing = [key for key in _KEYS if key not in tables]
    if missing:
        raise EstimatorError(
            f"the model has no {', '.join(missing)}; give {', '.join(_KEYS)}, or name a shipped "
            f'model with model = "…": {", ".join(MODELS)}'
        )
    try:
        model = Model(
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
    return _with_laws(model, tables.get("law", []))


def _with_laws(model: Model, tables: Any) -> Model:
    if not isinstance(tables, Sequence) or not all(isinstance(t, Mapping) for t in tables):
        raise EstimatorError("law takes a list of tables, each [[law]] with its kind")
    laws = tuple(_law(table, f"law[{i}]") for i, table in enumerate(tables))
    return replace(model, laws=(*model.laws, *laws)) if laws else model


def _law(table: Mapping[str, Any], key: str) -> Law:
    for name in table:
        if name not in _LAW_KEYS:
            raise EstimatorError(f"{key}.{name}: {did_you_mean(str(name), _LAW_KEYS)}")
    parts = {name: table.get(name, {}) for name in _LAW_KEYS[1:]}
    for name, part in parts.items():
        if not isinstance(part, Mapping):
            raise EstimatorError(f"{key}.{name} takes a table, such as {{ speed_motor = 1.0 }}")
    drive, acts, parameters = parts.values()
    if not all(map(_is_number, drive.values())) or not all(
        _is_number(value) or isinstance(value, str) for value in parameters.values()
    ):
        kind = LAWS.get(str(table.get("kind")))
        roles = ", ".join(kind.roles if kind else ("unknown",))
        raise EstimatorError(
            f"{key}: drive takes numbers, and parameters names or numbers; the roles of "
            f"{table.get('kind')!r} are {roles}"
        )
    try:
        return Law(
            str(table.get("kind", "")),
            {name: float(value) for name, value in drive.items()},
            {name: str(formula) for name, formula in acts.items()},
            dict(parameters),
        )
    except EstimatorError as error:
        raise EstimatorError(f"{key}: {error}") from error


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
