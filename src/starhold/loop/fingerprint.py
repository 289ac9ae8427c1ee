"""A hash of all sources that a kernel is built from.

Numba's disk cache watches the file of the kernel alone. A kernel that is filed under this hash is looked up anew when any
equation, model or law has changed, so the cache is never stale.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from types import ModuleType

import numba
import numpy as np

import starhold

PACKAGES = ("algebra", "models", "laws", "loop")


@cache
def fingerprint(outside: tuple[str, ...] = ()) -> str:
    """SHA-256 (hex) over the equations' packages, the named outside modules with what they import, and the compiler."""
    root = Path(starhold.__file__).parent
    files = [file for package in PACKAGES for file in sorted((root / package).rglob("*.py"))]
    files += _files_of(outside)
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {sys.version}".encode())
    for file in files:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def outside_modules(functions: Iterable[object]) -> tuple[str, ...]:
    """The modules of these functions that are not part of starhold."""
    names = {str(getattr(function, "__module__", "")) for function in functions}
    return tuple(sorted(name for name in names if not name.startswith("starhold.")))


def _files_of(modules: tuple[str, ...]) -> list[Path]:
    """Source files of the modules and, transitively, of those they import, but not of installed libraries other than the
    packages that the modules themselves belong to."""
    own = {name.partition(".")[0] for name in modules}
    todo, seen = [sys.modules[name] for name in modules if name in sys.modules], dict[str, Path]()
    while todo:
        module = todo.pop()
        file = getattr(module, "__file__", None)
        root = module.__name__.partition(".")[0]
        if file is None or module.__name__ in seen or (root not in own and _is_installed(module, file)):
            continue
        seen[module.__name__] = Path(file)
        todo += _imports(module, Path(file))
    return [seen[name] for name in sorted(seen)]


def _is_installed(module: ModuleType, file: str) -> bool:
    library = module.__name__.partition(".")[0] in sys.stdlib_module_names or not file.endswith(".py")
    return library or "site-packages" in file or module.__name__.startswith("starhold.")


def _imports(module: ModuleType, file: Path) -> list[ModuleType]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = "." * node.level + (node.module or "")
            base = _absolute(package, module)
            names |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
    return [sys.modules[name] for name in sorted(names) if name in sys.modules]


def _absolute(name: str, module: ModuleType) -> str:
    """The absolute name of a possibly relative import."""
    return resolve_name(name, module.__package__) if name.startswith(".") else name
