"""The independent checker of certificates: it shares no code with the certifier, and reads the claims anew."""

from starhold.checker.check import Finding, check, check_file, passed

__all__ = ["Finding", "check", "check_file", "passed"]
