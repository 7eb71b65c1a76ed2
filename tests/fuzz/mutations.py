"""What can be wrong with a file: tables with some entries replaced, removed, doubled or moved."""

import copy
import datetime
from typing import Any

from hypothesis import strategies as st

WORDS = ("k_T", "1/J_a", "f_m", "f_c", "step", "held", "smooth", "glr", "rpem-forgetting",
         "pipe:true", "nobody.py:Nothing", "../../etc/passwd", "fm_step-v1", "", " ", "a" * 400,
         "\u202e\u0000", "<b>", "1e400", "0/0", "__class__", "[forgetting=0.9]")  # fmt: skip
NUMBERS = (0, 1, -1, 2, 0.0, -0.0, 0.5, 1e-12, 1e-320, 1e9, 1e30, 1e308, -1e308, 2**31, 2**63,
           -(2**70), 10**400, float("inf"), float("-inf"), float("nan"), True, False)  # fmt: skip
JUNK = (b"", b"\xff\xfe", b"[" * 3000, b"{" * 3000, b'"', b"\n", b"\0", b"1" * 6000, b"nan", b"=")
DATE = datetime.date(2020, 2, 29)


def nested(depth: int, value: Any) -> Any:
    """Return lists in lists."""
    for _ in range(depth):
        value = [value]
    return value


simple = st.one_of(
    st.sampled_from(NUMBERS), st.sampled_from(WORDS), st.floats(), st.integers(),
    st.text(max_size=20).filter(lambda text: text.isprintable()), st.just(DATE),
)  # fmt: skip
values = st.one_of(
    simple,
    st.lists(simple, max_size=3),
    st.dictionaries(st.sampled_from(WORDS), simple, max_size=2),
    st.builds(nested, st.sampled_from([2, 20, 200, 2000]), simple),
)


@st.composite
def mutated(draw: st.DrawFn, good: list[dict[str, Any]]) -> dict[str, Any]:
    """Draw tables like some of the good ones, with one to three entries that are not."""
    tables = copy.deepcopy(draw(st.sampled_from(good)))
    others = [path for one in good for path in places(one)]
    for _ in range(draw(st.integers(1, 3))):
        found = places(tables)
        path = draw(st.sampled_from(found)) if found else ()
        match draw(st.sampled_from(["replace", "replace", "replace", "remove", "add", "swap"])):
            case "replace" if path:
                put(tables, path, draw(values))
            case "remove" if path:
                remove(tables, path)
            case "swap" if path:
                other = draw(st.sampled_from(others))
                put(tables, path[:-1] + other[-1:], draw(values))
            case _:
                tables[draw(st.sampled_from([*WORDS, *(str(p[0]) for p in others)]))] = draw(values)
    return tables


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all entries of nested tables, those of a table's own too."""
    entries = value.items() if isinstance(value, dict) else ()
    entries = enumerate(value) if isinstance(value, list) else entries
    inner = [path] if path else []
    if len(path) > 8:
        return inner
    for key, entry in entries:
        inner += places(entry, (*path, key))
    return inner


def put(tables: Any, path: tuple[Any, ...], value: Any) -> None:
    """Replace an entry, or add it where that can be done."""
    for key in path[:-1]:
        tables = tables[key]
    if isinstance(tables, dict):
        tables[str(path[-1])] = value
    elif isinstance(path[-1], int) and path[-1] < len(tables):
        tables[path[-1]] = value
    else:
        tables.append(value)


def remove(tables: Any, path: tuple[Any, ...]) -> None:
    """Remove an entry."""
    for key in path[:-1]:
        tables = tables[key]
    del tables[path[-1]]


@st.composite
def damaged(draw: st.DrawFn, good: list[bytes]) -> bytes:
    """Draw bytes like some of the good ones, with a piece that is cut out, doubled or replaced."""
    data = draw(st.sampled_from(good))
    start = draw(st.integers(0, len(data)))
    stop = draw(st.integers(start, min(len(data), start + 40)))
    junk = draw(st.sampled_from([*JUNK, data[:200]]))
    return data[:start] + junk + data[stop:]
