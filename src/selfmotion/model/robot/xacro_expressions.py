"""Expressions in xacro files: sums and lists are evaluated, anything else of Python is refused."""

import ast
import builtins
import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

# Xacro evaluates ${…} and $(eval …) as Python. It forbids some names, but a lambda, a dictionary of
# methods or a frame circumvents that, and $(eval …) has all of Python's functions. Descriptions
# come from others: only these forms are evaluated.
_FORMS = (
    *(ast.Expression, ast.Constant, ast.Name, ast.Load, ast.Store, ast.Attribute, ast.Subscript),
    *(ast.Slice, ast.List, ast.Tuple, ast.Dict, ast.Set, ast.Starred, ast.Call, ast.keyword),
    *(ast.IfExp, ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.Compare, ast.JoinedStr),
    *(ast.FormattedValue, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp),
    *(ast.comprehension, ast.boolop, ast.operator, ast.unaryop, ast.cmpop),
)
# Prefixes of attributes that lead from a value to its code.
_INNER = ("gi_", "cr_", "ag_", "tb_", "co_", "func_")
# Such attributes of frames.
_FRAMES = ("f_back", "f_builtins", "f_code", "f_globals", "f_locals", "mro")
# Functions of xacro that expose values' internals, or make classes.
_LEFT_OUT = ("type", "vars")
# Python's functions of $(eval …) in xacro's documentation.
_FUNCTIONS = ("list", "dict", "map", "str", "float", "int")


class ExpressionError(Exception):
    """An expression does more than arithmetic."""


def check_expression(text: str) -> None:
    """Raise `ExpressionError` for an expression that does more than arithmetic.

    Raises
    ------
    ExpressionError
    SyntaxError
        It is no expression of Python.
    """
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        code = _code_in(node)
        if code:
            raise ExpressionError(
                f"the expression '{text.strip()[:60]}' is code ({code}), which is never run; "
                f"write a number, a text or arithmetic"
            )


def _code_in(node: ast.AST) -> str:
    """Return what a node is that leads beyond arithmetic; "" for nothing."""
    if not isinstance(node, _FORMS):
        return type(node).__name__.lower()
    if isinstance(node, ast.Name) and node.id.startswith("__"):
        return node.id
    if isinstance(node, ast.Attribute):
        name = node.attr
        if name.startswith(("__", *_INNER)) or name in _FRAMES:
            return name
    return ""


@contextlib.contextmanager
def only_arithmetic(find: Any) -> Iterator[None]:
    """Let xacro evaluate nothing but arithmetic, and find packages by the function `find`.

    The functions of xacro that evaluate expressions are replaced while the context lasts.

    State of xacro between files, and its additions to the reader of YAML, are removed afterwards.
    """
    import xacro
    import yaml
    from xacro import substitution_args

    xacro_eval = xacro.safe_eval

    def evaluate(text: str, known: Any, local: Any = None) -> Any:
        check_expression(text)
        return xacro_eval(text, known, local)

    def evaluate_argument(text: str, context: Any) -> str:
        check_expression(text)
        arguments = context.setdefault("arg", {})
        known = _Arguments(
            arguments,
            {
                **{
                    key: item for key, item in substitution_args._eval_dict.items() if key[0] != "_"
                },
                "find": find,
                "arg": lambda name: substitution_args.convert_value(arguments[name], "auto"),
                "dirname": lambda: substitution_args._eval_dirname(context["filename"]),
            },
            substitution_args.convert_value,
        )
        functions = {name: getattr(builtins, name) for name in _FUNCTIONS}
        return str(
            eval(compile(text.strip(), "<xacro>", "eval"), {"__builtins__": functions}, known)
        )

    symbols = xacro.create_global_symbols()
    for name in _LEFT_OUT:
        symbols["python"].pop(name, None)
    constructors = dict(yaml.SafeLoader.yaml_constructors)
    replacements: list[tuple[Any, str, Any]] = [
        (xacro, "safe_eval", evaluate),
        (xacro, "_global_symbols", symbols),
        (substitution_args, "_eval", evaluate_argument),
        (substitution_args, "_eval_find", find),
    ]
    before = [(module, name, getattr(module, name)) for module, name, _ in replacements]
    try:
        for module, name, item in replacements:
            setattr(module, name, item)
        yield
    finally:
        for module, name, item in before:
            setattr(module, name, item)
        yaml.SafeLoader.yaml_constructors = constructors


class _Arguments(dict[str, Any]):
    """Names in $(eval …): functions, and arguments by their values."""

    def __init__(
        self, arguments: Mapping[str, str], functions: Mapping[str, Any], convert: Any
    ) -> None:
        super().__init__(functions)
        self._arguments, self._convert = arguments, convert

    def __missing__(self, name: str) -> Any:
        return self._convert(self._arguments[name], "auto")
