"""Campaigns: many flights of one scenario, each with its own numbers drawn from distributions, and what they show."""
