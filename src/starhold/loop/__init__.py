"""A closed loop of parts (`closed_loop`), the equations of its control step (`step`), and the kernels that repeat them
(`kernels`)."""
