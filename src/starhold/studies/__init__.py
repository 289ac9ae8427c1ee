"""Flights with their metrics and certificates, and what is asked of many: comparisons, sweeps, failures, budgets. Each body
has a study in `bodies`."""
