"""The independent checker of certificates. It shares with the certifier the equations of laws and parts, which claims are
about, and the arithmetic of `algebra`; what it derives, bounds and proves is its own. A test of its imports keeps it so.
"""

from starhold.checker.check import Finding, check, check_file, passed

__all__ = ["Finding", "check", "check_file", "passed"]
