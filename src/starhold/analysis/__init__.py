"""Numbers from runs: metrics, rankings, transients, the cost of a call, the linear loop and its margins, and the time at
which a flight leaves a claim."""
