"""Settings of the whole test run."""

import os

# Before NumPy loads: on small matrices the library's threads only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import settings

settings.register_profile("starhold", deadline=None, derandomize=True)
settings.load_profile("starhold")
