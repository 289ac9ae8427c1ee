"""The independent checker of certificates: the kernel decides every proof, and what stands beside the proofs must not say
more. It shares nothing with the certifier; a test of its imports keeps it so."""

from starhold.checker.check import Finding, check, check_file, passed

__all__ = ["Finding", "check", "check_file", "passed"]
