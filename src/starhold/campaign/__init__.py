"""Campaigns: many runs with dispersions, their verdicts and their drivers. The package is callable: `starhold.campaign(...)`
is the function of the Python interface."""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Flying(ModuleType):
    def __call__(self, *args: Any, **keywords: Any) -> Any:
        # The interface is above all layers; only the function is looked up by this name.
        return import_module("starhold.api").campaign(*args, **keywords)


sys.modules[__name__].__class__ = _Flying
