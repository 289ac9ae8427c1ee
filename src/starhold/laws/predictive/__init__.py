"""The optimiser of the predictive law: the problem, its limits, motion over the horizon, and the solver."""
