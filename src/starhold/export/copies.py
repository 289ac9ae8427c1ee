"""Copies of equations call each other through a recorder, which may keep the calls: else a recording is one long list of
operations, in which the equations that an equation calls vanish."""

from collections.abc import Callable
from functools import update_wrapper
from types import CellType, FunctionType, ModuleType
from typing import Any

from starhold.algebra import operations, structure, structured, words

COPIED = "__copied__"
"""The mark of a copied module."""
_WRITTEN_OUT = frozenset(module.__name__ for module in (operations, structure, structured, words))
_RECORDED_ONCE = structured.function(lambda: None).__code__


class Copies:
    """Modules are copied with every equation replaced by a function that hands the call, of a copy of the equation, to
    `call(copy, values)`. Nothing of the modules themselves is changed."""

    def __init__(self, call: Callable[[Callable[..., Any], tuple[Any, ...]], Any]) -> None:
        self._call = call
        self._modules: dict[int, ModuleType] = {}
        self._copies: dict[Any, Callable[..., Any]] = {}
        self._callers: dict[Any, Callable[..., Any]] = {}

    def seen(self, value: Any) -> Any:
        """Return what stands for a value in a copy: for an equation a function that hands on the call, for a table or a
        module of equations another one of such functions."""
        if isinstance(value, FunctionType):
            return self._caller(value)
        if isinstance(value, dict) and value and all(isinstance(x, FunctionType) for x in value.values()):
            return {key: self.seen(x) for key, x in value.items()}
        return self._module(vars(value)) if isinstance(value, ModuleType) and _has_equations(vars(value)) else value

    def copy(self, equation: Any) -> Callable[..., Any]:
        """Return the copy of an equation."""
        if equation not in self._copies:
            cells = tuple(CellType(self.seen(cell.cell_contents)) for cell in equation.__closure__ or ())
            names = vars(self._module(equation.__globals__))
            copy = FunctionType(equation.__code__, names, equation.__name__, equation.__defaults__, cells)
            copy.__kwdefaults__ = equation.__kwdefaults__
            self._copies[equation] = update_wrapper(copy, equation)
        return self._copies[equation]

    def _module(self, names: dict[str, Any]) -> ModuleType:
        if id(names) not in self._modules:
            module = self._modules[id(names)] = ModuleType(names["__name__"])
            vars(module).update(names, **{COPIED: True})
            vars(module).update({name: self.seen(x) for name, x in names.items() if not name.startswith("__")})
        return self._modules[id(names)]

    def _caller(self, equation: Any) -> Callable[..., Any]:
        if equation not in self._callers:
            inner = equation.__wrapped__ if equation.__code__ is _RECORDED_ONCE else equation

            def call(*values: Any, **named: Any) -> Any:
                copy = self.copy(inner)
                return copy(*values, **named) if named else self._call(copy, values)

            # `where` decides by itself on truths that are known while recording.
            self._callers[equation] = call if _has_equations(inner.__globals__) and inner.__name__ != "where" else equation
        return self._callers[equation]


def _has_equations(names: dict[str, Any]) -> bool:
    """Tell whether a module is one of equations: of this package, or a file with a part."""
    name = str(names.get("__name__", ""))
    return "CARD" in names or (name.startswith("starhold.") and name not in _WRITTEN_OUT)
