"""
Modules of generated source: a function and all that it reaches, in a file named after its content.

numba keeps machine code of functions of modules, but of none that is made of others at run time.
So what is made at run time is written down. Every function has the digest of its source, and of
that of all functions that it calls, in its name: no two have the same, in whatever process.
"""

import ast
import hashlib
import inspect
import textwrap
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from flexaxis.estimators.models.compiler import Compiled

LITERALS = int | float | complex | str | tuple | None
WHOLE = "cache=True, nogil=True, error_model='numpy'"
PART = "error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True"


class Rendered(NamedTuple):
    """
    The source of a function.

    Attributes
    ----------
    name : str
        Its own, and the digest of the source.
    lines : tuple of str
        What the function needs of imports, constants and functions, in order, each once; itself
        comes last.
    """

    name: str
    lines: tuple[str, ...]


def rendered(function: "Compiled") -> Rendered:
    """Return the source of a function, as a part of a module."""
    tree, values = _parsed(function.function)
    needs: dict[str, None] = {}
    tree = _Named(values, needs).visit(tree)
    options = PART + ", forceinline=True" * function.inline
    options += ", fastmath={'contract'}" * function.fused
    tree.decorator_list, tree.returns = [], None
    for argument in tree.args.args:
        argument.annotation = None
    body = ast.unparse(ast.fix_missing_locations(tree))
    name = f"{tree.name}_{digest(options, body)}"
    text = body.replace(f"def {tree.name}(", f"def {name}(", 1)
    return Rendered(name, (*needs, f"@njit({options})\n{text}"))


def written(function: "Compiled") -> str:
    """Return the source of a module with a function, which Python calls, as its last."""
    *lines, last = function.rendered.lines
    decorator, _, body = last.partition("\n")
    whole = decorator.replace(PART, WHOLE).replace(", forceinline=True", "")
    return "\n\n".join(["from numba import njit", *lines, f"{whole}\n{body}"]) + "\n"


def _parsed(function: Any) -> tuple[ast.FunctionDef, dict[str, Any]]:
    """Return a function as a tree without its docstring, and the values of names outside it."""
    if isinstance(function, str):
        tree, values = ast.parse(function).body[0], {"np": np}
    else:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        outside = inspect.getclosurevars(function)
        values = dict(outside.globals) | dict(outside.nonlocals)
    assert isinstance(tree, ast.FunctionDef), "only functions made by def are compiled"
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:] or [ast.Pass()]
    own = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and _is_set(node)}
    own |= {argument.arg for argument in tree.args.args}
    return tree, {name: value for name, value in values.items() if name not in own}


def _is_set(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


class _Named(ast.NodeTransformer):
    """
    Puts what names outside a function mean in their place.

    Parameters
    ----------
    values : mapping of str to object
    needs : dict
        Collects the lines that the function needs before it.
    """

    def __init__(self, values: dict[str, Any], needs: dict[str, None]) -> None:
        self.values, self.needs = values, needs

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id not in self.values:
            return node
        text = self._text(node.id, self.values[node.id])
        return ast.parse(text, mode="eval").body

    def _text(self, name: str, value: Any) -> str:
        made = getattr(value, "rendered", None)
        if isinstance(made, Rendered):
            self.needs.update(dict.fromkeys(made.lines))
            return made.name
        if isinstance(value, ModuleType):
            return self._imported(value.__name__)
        if isinstance(value, float) and not np.isfinite(value):
            return f"({'-' * (value < 0)}{self._imported('numpy')}.{abs(value)})"
        if isinstance(value, LITERALS):
            return repr(value)
        if isinstance(value, np.ndarray):
            numpy = self._imported("numpy")
            made = f"{numpy}.array({value.ravel().tolist()}, {numpy}.{value.dtype})"
            place = f"{name}_{digest(made, str(value.shape))}"
            self.needs[f"{place} = {made}.reshape({value.shape})"] = None
            return place
        origin = inspect.getmodule(value)
        assert origin is not None, f"{name} = {value!r} cannot be a part of compiled code"
        return f"{self._imported(origin.__name__)}.{value.__name__}"

    def _imported(self, module: str) -> str:
        name = module.replace(".", "_")
        self.needs[f"import {module} as {name}"] = None
        return name


def digest(*parts: str) -> str:
    """Return what tells texts from any others."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]
