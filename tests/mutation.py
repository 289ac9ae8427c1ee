"""Counts how many small errors in the source the tests find: `python tests/mutation.py --help`.

Each mutant is one changed expression in a copy of the tree. The test files nearest to its module run first, those that took
least in the last run before others, then all the rest; the first failure kills it, and so does a run without end. What
survives is a gap in the tests or a change without effect.
"""

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import namedtuple
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
GROUPS = {name: [f"{name}/**/*.py"] for name in ("checker", "kernel", "parts")}
GROUPS["step"] = ["loop/step.py", "loop/kernels.py"]
GROUPS["statistics"] = [f"campaign/{name}.py" for name in ("verdicts", "sequence", "sensitivity", "sampling", "drivers")]
"""Files below src/starhold; as many mutants of each group that has files."""
SIGNS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
ORDERS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
CALLS = {"less": "less_equal", "less_equal": "less"}
SAME = ("isinstance", "getattr", "zip", "both", "either", "minimum", "maximum", "max", "min", "dot", "add")
Mutant = namedtuple("Mutant", "operator line start end after")
"""The bytes `start` to `end` of a file read `after` instead."""


def changes(node: Any) -> Iterator[tuple[str, Any, ast.expr]]:
    """The name of each change that a node allows, the expression that is replaced, and what replaces it."""
    match node:
        case ast.BinOp(left, op, right):
            if type(op) in SIGNS:
                yield "sign", node, ast.BinOp(left, SIGNS[type(op)](), right)
            if isinstance(op, ast.Add | ast.Sub):
                yield "term", node, left
        case ast.Compare(left, [op, *ops], right) if type(op) in ORDERS:
            yield "order", node, ast.Compare(left, [ORDERS[type(op)](), *ops], right)
        case ast.Constant(bool()):
            pass
        case ast.Constant(int() | float() as value):
            yield "constant", node, ast.Constant(value + 1 if isinstance(value, int) or value == 0.0 else 2.0 * value)
        case ast.If(test) | ast.While(test):
            yield "condition", test, ast.UnaryOp(ast.Not(), test)
        case ast.IfExp(test, body, other):
            yield "branches", node, ast.IfExp(test, other, body)
        case ast.Call(ast.Name(name), [a, b], []) if name in CALLS:
            yield "order", node, ast.Call(ast.Name(CALLS[name]), [a, b], [])
        case ast.Call(ast.Name(name), [test, a, b, *more], keywords) if name in ("where", "select"):
            yield "branches", node, ast.Call(ast.Name(name), [test, b, a, *more], keywords)
        case ast.Call(function, [a, b, *more], keywords) if (
            getattr(function, "id", getattr(function, "attr", "")) not in SAME
        ):
            if not any(isinstance(each, ast.Starred) for each in (a, b)):
                yield "arguments", node, ast.Call(function, [b, a, *more], keywords)
        case ast.Return(ast.Call(_, [first, *_])) if not isinstance(first, ast.Starred | ast.GeneratorExp):
            yield "first argument", node.value, first


def computed(node: ast.AST) -> Iterator[ast.AST]:
    """What runs: no annotations, decorators, cards, examples, messages nor formatted strings."""
    card = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "CARD"
    if not card and not isinstance(node, ast.JoinedStr | ast.Raise) and getattr(node, "name", "") != "examples":
        yield node
        beside = [getattr(node, "annotation", None), getattr(node, "returns", None), *getattr(node, "decorator_list", ())]
        for child in ast.iter_child_nodes(node):
            if child not in beside:
                yield from computed(child)


def mutants(source: bytes) -> Iterator[Mutant]:
    """Every mutant of a module."""
    starts = [0, 0, *accumulate(map(len, source.splitlines(keepends=True)))]
    for node in computed(ast.parse(source)):
        for name, at, new in changes(node):
            start, end = starts[at.lineno] + at.col_offset, starts[at.end_lineno] + at.end_col_offset
            yield Mutant(name, at.lineno, start, end, f"({ast.unparse(new)})")


def nearest(root: Path, module: Path) -> list[str]:
    """The test files named after a module, then those that import it, or else its package."""
    package, stem = r"\.".join(module.parts[:-1]), module.stem
    names = rf"{package}\.{stem}\b|from {package} import [^\n]*\b{stem}\b"
    texts = {path.relative_to(root): path.read_text(encoding="utf-8") for path in sorted((root / "tests").rglob("*.py"))}
    first = [path for path, text in texts.items() if re.search(names, text)]
    helpers = [r"\.".join(path.with_suffix("").parts) for path in first if not path.name.startswith("test_")]
    second = [path for path, text in texts.items() if any(re.search(rf"{each}\b", text) for each in helpers)]
    first = [path for path in texts if path.stem == f"test_{stem}"] + first
    near = [str(path) for path in dict.fromkeys(first + second) if path.name.startswith("test_")]
    return near or nearest(root, module.parent)


class Trials:
    """Runs of the tests in a copy of the tree; those that fail there without any change are left out."""

    def __init__(self, root: Path, limit: int) -> None:
        self.root, self.limit, self.clean, self.broken, self.time = root, limit, set[str](), set[str](), 0
        known = ROOT / ".pytest_cache" / "v" / "starhold" / "seconds"
        self.seconds: dict[str, float] = json.loads(known.read_text()) if known.exists() else {}
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(".*", "__pycache__", "results"), dirs_exist_ok=True)

    def write(self, path: Path, source: bytes) -> None:
        """Write a module with a time of its own, by which Python sees that what it has compiled is old."""
        self.time += 1
        path.write_bytes(source)
        os.utime(path, (self.time, self.time))

    def failure(self, words: list[str]) -> str:
        """The first test that fails, or why there is none; nothing if all pass."""
        command = ["timeout", "-s", "KILL", str(self.limit), sys.executable, "-m", "pytest", "-x", "-q", "--tb=no"]
        command += ["-p", "no:cacheprovider", *words, *(f"--deselect={test}" for test in self.broken)]
        environment = os.environ | {"PYTHONPATH": str(self.root / "src")}
        done = subprocess.run(command, cwd=self.root, env=environment, capture_output=True, text=True)
        failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, flags=re.MULTILINE)
        return failed[1] if failed else "" if done.returncode in (0, 5) else f"pytest ended with {done.returncode}"

    def killer(self, path: Path, mutant: Mutant, rest: list[str]) -> str:
        """What kills a mutant; nothing if it survives."""
        source = path.read_bytes()
        near = nearest(self.root, path.relative_to(self.root / "src"))
        for words in (sorted(near, key=lambda file: self.seconds.get(file, 0.0)), rest):
            failed = "again" if words else ""
            while failed in self.broken | {"again"}:
                self.write(path, source[: mutant.start] + mutant.after.encode() + source[mutant.end :])
                failed = self.failure(words)
                self.write(path, source)
                if failed.startswith("tests/") and failed not in self.clean:
                    (self.broken if self.failure([failed]) else self.clean).add(failed)
            if failed:
                return failed
        return ""


def main() -> None:
    """Draw mutants, try the tests on each, and print what they find."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300, help="mutants in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=[*GROUPS], nargs="+", default=[*GROUPS], help="groups")
    parser.add_argument("--tests", default="--workers 2 tests", help="words for pytest after the nearest; '': none")
    parser.add_argument("--limit", type=int, default=1800, help="seconds after which a run counts as one without end")
    parser.add_argument("--output", type=Path, default=Path(os.devnull), help="a JSON file")
    options = parser.parse_args()
    results, draw = [], random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        trials, source = Trials(Path(folder), options.limit), Path(folder) / "src" / "starhold"
        files = {g: [p for pattern in GROUPS[g] for p in sorted(source.glob(pattern))] for g in options.only}
        pools = {g: [(p, m) for p in there for m in mutants(p.read_bytes())] for g, there in files.items() if there}
        for place, (group, pool) in enumerate(pools.items()):
            for path, mutant in draw.sample(pool, (options.count + place) // len(pools)):
                before = path.read_bytes()[mutant.start : mutant.end].decode()
                one = {"group": group, "file": str(path.relative_to(source)), "before": before, **mutant._asdict()}
                results.append(one | {"killer": trials.killer(path, mutant, options.tests.split())})
                print(*results[-1].values(), sep=" | ", flush=True)
                options.output.write_text(json.dumps(results, indent=1), encoding="utf-8")
    for group in [*pools, "all"]:
        killed = [one["killer"] != "" for one in results if group in (one["group"], "all")]
        print(f"{group:12}{sum(killed):6} killed of{len(killed):6}")


if __name__ == "__main__":
    main()
