"""Expansion of formulas such as ``"-(r^2*d_g + f_m)/J_m"`` into sums of monomials."""

import ast
from collections.abc import Mapping
from functools import lru_cache

from flexaxis.estimators.errors import EstimatorError

Terms = list[tuple[float, dict[str, int]]]
Monomial = tuple[float, Mapping[str, int]]


@lru_cache(maxsize=1024)
def multiply_out(entry: str) -> tuple[Monomial, ...]:
    """
    Expand a formula into a sum of monomials c·Πθ^e with coefficients c and integer exponents e.

    Parameters
    ----------
    entry : str
        Formula, such as ``"-(r^2*d_g + f_m)/J_m"``.

    Returns
    -------
    tuple of (coefficient, powers)
        One pair for each monomial, where ``powers`` maps parameter names to integer exponents. The
        formula ``"0"`` has no monomials.

    Raises
    ------
    EstimatorError
        If the string is not a formula that the function supports.

    Examples
    --------
    >>> multiply_out("-(2*a + 1)/b^2")
    ((-2.0, {'a': 1, 'b': -2}), (-1.0, {'b': -2}))
    """
    try:
        terms = _expand(ast.parse(entry.strip().replace("^", "**"), mode="eval").body)
    except (SyntaxError, ValueError, TypeError, ArithmeticError):
        raise EstimatorError(
            f"cannot read the formula {entry!r}; a formula can contain names, numbers, + - * /, "
            "brackets and integer powers, and each divisor must be a single nonzero term"
        ) from None
    return tuple((c, powers) for c, powers in terms if c != 0)


def _expand(node: ast.expr) -> Terms:
    terms: Terms
    match node:
        case ast.Constant(value=int() | float() as number):
            terms = [(float(number), {})]
        case ast.Name(id=name):
            terms = [(1.0, {name: 1})]
        case ast.UnaryOp(op=ast.USub(), operand=x):
            terms = _product([(-1.0, {})], _expand(x))
        case ast.BinOp(left=x, op=ast.Add() | ast.Sub() as op, right=y):
            sign = 1.0 if isinstance(op, ast.Add) else -1.0
            terms = _expand(x) + _product([(sign, {})], _expand(y))
        case ast.BinOp(left=x, op=ast.Mult(), right=y):
            terms = _product(_expand(x), _expand(y))
        case ast.BinOp(left=x, op=ast.Div(), right=y):
            terms = _product(_expand(x), _power(_expand(y), -1))
        case ast.BinOp(left=x, op=ast.Pow(), right=ast.Constant(value=int() as e)):
            terms = _power(_expand(x), e)
        case _:
            raise ValueError(node)
    return terms


def _power(terms: Terms, e: int) -> Terms:
    ((c, powers),) = terms
    return [(c**e, {k: e * p for k, p in powers.items()})]


def _product(left: Terms, right: Terms) -> Terms:
    return [
        (c * d, {k: e for k in p | q if (e := p.get(k, 0) + q.get(k, 0))})
        for c, p in left
        for d, q in right
    ]
