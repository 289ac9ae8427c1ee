"""Docstrings begin with a sentence that stands by itself."""

import ast
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "starhold"
FRAGMENT = re.compile(r"(What|The same|Of)\b")
"""Beginnings that need the name above, or the docstring before, to be understood."""


def docstrings(path):
    """Line and text of the docstrings of a file's module, classes and functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            text = ast.get_docstring(node)
            if text is not None:
                yield node.body[0].lineno, text


@pytest.mark.parametrize("folder", sorted({path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}))
def test_docstrings_begin_with_a_sentence(folder):
    place = SOURCE / folder
    found = [
        f"{path.relative_to(SOURCE)}:{line}: {text.splitlines()[0]}"
        for path in (sorted(place.rglob("*.py")) if place.is_dir() else [place])
        for line, text in docstrings(path)
        if FRAGMENT.match(text)
    ]
    assert found == []
