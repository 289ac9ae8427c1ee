"""The optimiser of the predictive law: the problem, its limits, the motion over the horizon, and the solver."""
