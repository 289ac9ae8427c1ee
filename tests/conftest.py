"""Settings of the whole test run."""

import gc
import os
import signal
import sys
from importlib.metadata import EntryPoint
from unittest.mock import patch

# Before NumPy loads: on small matrices the library's threads only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from starhold.kernel.numbers import Account
from starhold.loop import kernels
from starhold.trace import calling, machine
from tests.proofs import share
from tests.tiers import SEED, WHOLE, fewer

# Where modules are not to be kept once compiled, each process that a test starts would compile all of starhold anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell that starts the tests in the background has them ignore interrupts, which some of them send.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("starhold", deadline=None, derandomize=True, max_examples=fewer(100, 4))
settings.load_profile("starhold")

SECONDS = "starhold/seconds"
"""Where the cache keeps how long each file took in the last run."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give whole files to workers, those first that took longest in the last run: no worker is left with one at the end."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    seconds = config.cache.get(SECONDS, {}) if hasattr(config, "cache") else {}

    class LongestFirst(LoadFileScheduling):
        def _assign_work_unit(self, node):
            longest = max(self.workqueue, key=lambda file: seconds.get(file, 0.0))
            self.workqueue.move_to_end(longest, last=False)
            super()._assign_work_unit(node)

    return LongestFirst(config, log)


class Stopwatch:
    """Adds up how long the tests of each file take."""

    def __init__(self, cache):
        self.cache, self.seconds = cache, {}

    def pytest_runtest_logreport(self, report):
        file = report.nodeid.split("::")[0]
        self.seconds[file] = self.seconds.get(file, 0.0) + report.duration

    def pytest_sessionfinish(self):
        self.cache.set(SECONDS, self.cache.get(SECONDS, {}) | self.seconds)


def pytest_configure(config):
    # Of workers the one process that starts them counts.
    if not hasattr(config, "workerinput") and getattr(config, "cache", None) is not None:
        config.pluginmanager.register(Stopwatch(config.cache))


def pytest_report_header():
    return f"drawn by STARHOLD_SEED={SEED}"


def pytest_terminal_summary(terminalreporter):
    # A quiet run has no header.
    if terminalreporter.stats.get("failed"):
        terminalreporter.write_line(f"What is drawn is drawn again by STARHOLD_SEED={SEED}.")


def pytest_collection_finish():
    """Leave what is loaded by now out of the collections of garbage: it stays to the end."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _proofs(tmp_path_factory):
    """Workers keep what they prove in one folder of the run, beside their own."""
    own = tmp_path_factory.getbasetemp()
    share((own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "proofs")


@pytest.fixture(autouse=True)
def _account():
    """Begin each test with all the work that the kernel may do, whatever a test before spent."""
    Account.open()


@pytest.fixture(scope="session", autouse=True)
def _plain_code():
    """Compile kernels without optimisation: the same bits in a tenth of the time. `make test-all` has what users have."""
    if not WHOLE:
        _compile_by(_plainly)


@pytest.fixture(scope="module")
def optimised():
    """Compile kernels as users have them: for tests that what LLVM makes of a program gives its bits."""
    with pytest.MonkeyPatch.context() as patched:
        _compile_by(machine.load, patched.setattr)
        patched.setattr(kernels, "_KERNELS", {})
        yield


def _compile_by(load, put=setattr):
    for module in (kernels, calling):
        put(module, "load", load)


def _plainly(program, width, passes=None):
    def target():
        llvm = machine._llvm()
        features = llvm.get_host_cpu_features().flatten()
        return llvm.Target.from_default_triple().create_target_machine(
            opt=0, cpu=llvm.get_host_cpu_name(), features=features
        )

    with patch.object(machine, "_machine", target):
        return machine.load(program, width, passes=False)


@pytest.fixture
def offer(monkeypatch):
    """Let modules in a folder be the parts of another package, by its entry points, until the test ends."""
    from starhold.laws import catalogue as laws
    from starhold.parts import catalogue as parts

    def forget():
        for remembered in (laws._installed, laws._of_body, laws._commands, parts.parts):
            remembered.cache_clear()

    def give(folder, *names):
        points = [EntryPoint(name, name, "starhold.parts") for name in names]
        monkeypatch.syspath_prepend(str(folder))
        for name in names:
            monkeypatch.delitem(sys.modules, name, raising=False)
        monkeypatch.setattr(parts, "entries", lambda group: points if group == "starhold.parts" else [])
        forget()

    yield give
    monkeypatch.undo()
    forget()


@pytest.fixture
def quiet_plots():
    """What Matplotlib draws by default: libraries that other tests import change what plots look like."""
    from matplotlib import pyplot, rc_context, rcdefaults

    with rc_context({"backend": "agg"}):
        rcdefaults()
        yield
        pyplot.close("all")
