"""Scenarios from files or from Python. The package is callable: `sh.scenario({...})` calls `make_scenario`."""

import sys
from types import ModuleType
from typing import Any


class _Making(ModuleType):
    def __call__(self, *args: Any, **keywords: Any) -> Any:
        from starhold.scenario.reading import make_scenario

        return make_scenario(*args, **keywords)


sys.modules[__name__].__class__ = _Making
