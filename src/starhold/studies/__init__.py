"""Flights with their metrics and certificates, and studies of many flights: comparisons, sweeps, failures, budgets. Each
body has a study in `bodies`."""
