"""The optimiser of the predictive law consists of the problem, its limits, motion over the horizon, and the solver."""
