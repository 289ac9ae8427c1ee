"""The version of starhold."""

__version__ = "0.1.0"
