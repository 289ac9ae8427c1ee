"""Numbers from runs: metrics, rankings, transients, margins, the cost of a call, the linear loop, and when a flight leaves a
claim."""
