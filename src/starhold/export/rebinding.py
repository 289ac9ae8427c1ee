"""Equations are run as copies that call each other through a hook, so that a recorder may keep the calls.

A recording of an equation is one long list of operations, because the equations that it calls vanish in it. Here each
function is copied with other globals, in which every equation is replaced by what asks the hook first. Nothing of the
modules is changed.
"""

from __future__ import annotations

from collections.abc import Callable
from types import CellType, FunctionType, ModuleType
from typing import Any

from starhold.algebra import operations, structured
from starhold.algebra.structured import repeat

_LEFT = (
    "starhold.algebra.structured",
    "starhold.algebra.structure",
    "starhold.algebra.operations",
    "starhold.algebra.words",
)
_INLINE = frozenset({"where"})
"""What decides on truths that are known while recording."""


class Module:
    """A module is seen through this with its equations copied."""

    def __init__(self, module: Any, rebinder: Rebinder) -> None:
        self._module, self._rebinder = module, rebinder

    def __getattr__(self, name: str) -> Any:
        return self._rebinder.seen(getattr(self._module, name))


class Rebinder:
    """Copies equations; each call of one that another makes goes to `hook(copy, values, must)`, `must` where the equation
    asks to be recorded as a function."""

    def __init__(self, hook: Callable[[Callable[..., Any], tuple[Any, ...], bool], Any]) -> None:
        self._hook = hook
        self._globals: dict[int, dict[str, Any]] = {}
        self._copies: dict[Any, Callable[..., Any]] = {}
        self._calls: dict[Any, Callable[..., Any]] = {}

    def seen(self, value: Any) -> Any:
        """Return what stands for a value: of an equation what calls its copy, of a table of equations a table of those."""
        if isinstance(value, FunctionType):
            return self._call(value)
        if isinstance(value, dict) and value and all(isinstance(x, FunctionType) for x in value.values()):
            return {key: self.seen(x) for key, x in value.items()}
        if isinstance(value, ModuleType) and _is_ours(vars(value)):
            return Module(value, self)
        return value

    def copy(self, equation: Callable[..., Any]) -> Callable[..., Any]:
        """Return the copy of an equation."""
        if equation not in self._copies:
            function: Any = equation
            cells = tuple(CellType(self.seen(cell.cell_contents)) for cell in function.__closure__ or ())
            made = FunctionType(function.__code__, self._renewed(function), function.__name__, function.__defaults__, cells)
            made.__kwdefaults__, made.__doc__, made.__module__ = (
                function.__kwdefaults__,
                function.__doc__,
                function.__module__,
            )
            made.__annotations__ = function.__annotations__
            self._copies[equation] = made
        return self._copies[equation]

    def _renewed(self, function: Any) -> dict[str, Any]:
        own = function.__globals__
        if id(own) not in self._globals:
            self._globals[id(own)] = new = {**own, "__copied__": True}
            new.update({name: self.seen(value) for name, value in own.items() if not name.startswith("__")})
        return self._globals[id(own)]

    def _call(self, function: FunctionType) -> Callable[..., Any]:
        if function in self._calls:
            return self._calls[function]
        must = _is_from(function, structured) and hasattr(function, "__wrapped__")
        equation: Any = function.__wrapped__ if must else function  # pyright: ignore[reportFunctionMemberAccess]
        if not must and (_is_from(function, operations) or not _is_equation(function)):
            self._calls[function] = function
            return function

        def call(*values: Any, **named: Any) -> Any:
            copy = self.copy(equation)
            return copy(*values, **named) if named else self._hook(copy, values, must)

        self._calls[function] = call
        return call


def _is_from(function: FunctionType, module: ModuleType) -> bool:
    return function.__code__.co_filename == repeat.__code__.co_filename if module is structured else (
        function.__code__.co_filename == operations.operation.__code__.co_filename
    )  # fmt: skip


def _is_equation(function: FunctionType) -> bool:
    name = function.__globals__.get("__name__", "")
    return _is_ours(function.__globals__) and name not in _LEFT and function.__name__ not in _INLINE


def _is_ours(names: dict[str, Any]) -> bool:
    """Tell whether a module is one of equations: of this package, or a file with a part."""
    return str(names.get("__name__", "")).startswith("starhold.") or "CARD" in names
