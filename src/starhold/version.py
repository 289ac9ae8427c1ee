"""The version of starhold."""

__version__ = "0.3.0"
