"""The checker shares no code with what it checks."""

import ast
from pathlib import Path

import starhold.checker

ALLOWED = tuple(f"starhold.{part}" for part in ("checker.", "algebra.", "laws.", "parts.", "kernel.", "errors"))


def modules_of(path):
    """What a file imports, by full names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: the names of modules are written out"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_the_checker_imports_nothing_of_the_certifier():
    own = list(Path(starhold.checker.__file__).parent.rglob("*.py"))
    assert len(own) >= 3
    strange = [
        (path.name, module)
        for path in own
        for module in modules_of(path)
        if module.startswith("starhold") and not module.startswith(ALLOWED)
    ]
    assert not strange
