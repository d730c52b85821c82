"""Read an expression that a user wrote as text, strictly, into CasADi."""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Mapping

import casadi as ca

from firmloop.identify.error import IdentifyError

_LONGEST = 2000  # characters
_DRY = 1e-12

_ONE: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    # A level that a stage of the integrator takes below zero must not end the simulation, and nor must the slope there.
    "sqrt": lambda x: ca.if_else(x > _DRY, ca.sqrt(ca.fmax(x, _DRY)), 0.0),
    "exp": ca.exp,
    "log": ca.log,
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "tanh": ca.tanh,
    "abs": ca.fabs,
    "sign": ca.sign,
}
_MANY: Mapping[str, Callable[[ca.SX, ca.SX], ca.SX]] = {"min": ca.fmin, "max": ca.fmax}
_BINARY: Mapping[type[ast.operator], Callable[[ca.SX, ca.SX], ca.SX]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


def read_expression(text: object, known: Mapping[str, ca.SX], where: str) -> ca.SX:
    """Turn `text` into an expression of the `known` names; sqrt of what is negative is 0.

    Allowed are numbers, names, + - * / **, brackets and sqrt exp log sin cos tan tanh abs sign min max. IdentifyError
    begins with `where` and shows the part that is wrong.
    """
    if isinstance(text, int | float) and not isinstance(text, bool):
        return ca.SX(float(text))
    if not isinstance(text, str) or not text.strip():
        raise IdentifyError(f'{where} is {text!r}; it must be an expression as text, such as "-k_N_m*x_m/m_kg"')
    if len(text) > _LONGEST:
        raise IdentifyError(f"{where} has {len(text)} characters; an expression has at most {_LONGEST}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of 1if x, which no expression may hold
            tree = ast.parse(text.strip(), mode="eval")
        return _value(tree.body, known, where, text.strip())
    except (SyntaxError, ValueError, RecursionError, MemoryError, OverflowError):
        raise IdentifyError(f"{where}: {_shown(text)} is no expression; write it like -k_N_m*x_m/m_kg") from None


def _value(node: ast.expr, known: Mapping[str, ca.SX], where: str, text: str) -> ca.SX:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        number = float(str(node.value))
        if not math.isfinite(number):
            raise IdentifyError(f"{where}: {_part(node, text)} is too large a number")
        return ca.SX(number)
    if isinstance(node, ast.Name):
        if node.id not in known:
            names = ", ".join(known)
            raise IdentifyError(f"{where}: {node.id!r} is unknown in {_shown(text)}; it may use {names}")
        return known[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _value(node.operand, known, where, text)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left, right = _value(node.left, known, where, text), _value(node.right, known, where, text)
        return _BINARY[type(node.op)](left, right)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _call(node, node.func.id, known, where, text)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
        raise IdentifyError(f"{where}: ^ in {_shown(text)} is no power here; write x**2 for the square of x")
    raise IdentifyError(
        f"{where}: {_part(node, text)} is not allowed in {_shown(text)}; "
        f"use numbers, names, + - * / ** and {', '.join((*_ONE, *_MANY))}"
    )


def _call(node: ast.Call, name: str, known: Mapping[str, ca.SX], where: str, text: str) -> ca.SX:
    values = [_value(argument, known, where, text) for argument in node.args]
    if name in _ONE and len(values) == 1:
        return _ONE[name](values[0])
    if name in _MANY and len(values) >= 2:
        result = values[0]
        for value in values[1:]:
            result = _MANY[name](result, value)
        return result
    if name in _ONE or name in _MANY:
        rule = "one value" if name in _ONE else "two values or more"
        raise IdentifyError(f"{where}: {_part(node, text)}: {name} takes {rule}")
    raise IdentifyError(f"{where}: {name!r} is no function here; known: {', '.join((*_ONE, *_MANY))}")


def _part(node: ast.expr, text: str) -> str:
    return _shown(ast.get_source_segment(text, node) or text)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else f"{text[:57]}...")
