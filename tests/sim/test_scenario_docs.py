"""The page on scenarios says what the code does: keys, defaults, examples, messages."""

import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from flexaxis.sim.parameters import DATA_SHEET, LAW_NAMES
from flexaxis.sim.scenario import Scenario, parse_scenario
from flexaxis.sim.tables.config import kinds
from flexaxis.sim.tables.excitation import Excitation, Multisine
from flexaxis.sim.tables.faults import Fault

PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
CELLS = [
    (key, [cell.strip(" `") for cell in row.split("|")])
    for row in PAGE.splitlines()
    if row.startswith("| `")
    for key in re.findall(r"`([^`]+)`", row.split("|")[1])
]
ROWS = dict(CELLS)
AT_THE_TOP = dict(reversed(CELLS))  # where an excitation has a key of the same name


def leaves(table: type[BaseModel], prefix: str = ""):
    """Yield each plain key of a table and of the tables in it, with its default."""
    for name, field in table.model_fields.items():
        optional = [
            t for t in get_args(field.annotation) if isinstance(t, type) and t is not type(None)
        ]
        if isinstance(field.default, BaseModel) and name != "excitation":
            yield from leaves(type(field.default), f"{prefix}{name}.")
        elif name in ("known", "nuisance"):
            continue  # keys of any name, and the tables of a fault
        elif field.default is None and optional and issubclass(optional[0], BaseModel):
            yield from leaves(optional[0], f"{prefix}{name}.")
        elif name not in ("excitation", "fault", "parameters", "kind"):
            yield prefix + name, field


@pytest.mark.parametrize(
    ("rows", "key", "field"),
    [
        *((AT_THE_TOP, *leaf) for leaf in leaves(Scenario)),
        *((ROWS, *leaf) for leaf in leaves(Multisine)),
    ],
    ids=lambda value: "" if isinstance(value, dict) else str(value)[:20],
)
def test_every_key_is_explained_with_its_default(rows, key, field):
    default = rows[key][3]
    if field.is_required() or field.default is None:
        assert default == "–"
    elif key in ("low", "high"):
        assert str(field.default) in default
    elif isinstance(field.default, tuple):
        assert default == str(list(field.default)).replace("'", '"')
    else:
        shown = f'"{field.default}"' if isinstance(field.default, str) else str(field.default)
        shown = shown.lower() if isinstance(field.default, bool) else shown
        assert default == shown


def test_every_key_of_every_kind_is_explained():
    for table in (*kinds(Fault).values(), *kinds(Excitation).values()):
        assert set(table.model_fields) <= {*ROWS, "kind"}
        assert f'"{table.model_fields["kind"].default}"' in PAGE


def test_no_key_is_explained_that_does_not_exist():
    known = {key for key, _ in leaves(Scenario)} | {"parameters.X"} | set(LAW_NAMES)
    known |= {f"known.{name}" for name in ("X", "spread", *DATA_SHEET)}
    for table in (*kinds(Fault).values(), *kinds(Excitation).values()):
        known |= set(table.model_fields)
    before_records = PAGE[: PAGE.index("## Records")]
    explained = {key for key in ROWS if f"| `{key}`" in before_records}
    assert explained <= known


def test_examples_are_valid():
    whole, fault = EXAMPLES
    assert parse_scenario(whole).name == "my_fm_step"
    assert len(parse_scenario(whole + fault).fault) == 3
