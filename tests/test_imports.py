"""What several test modules use stands in modules that are no tests, so that a test may be moved or run alone."""

import ast
from pathlib import Path

HERE = Path(__file__).parent


def imported(path):
    """What a file imports, by full names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module or ''}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_no_module_imports_a_test():
    modules = list(HERE.rglob("*.py"))
    assert len(modules) > 100
    found = [(path.name, name) for path in modules for name in imported(path) if ".test_" in f".{name}"]
    assert not found
