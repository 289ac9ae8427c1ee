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
from tests import workers
from tests.proofs import share
from tests.tiers import SEED, WHOLE, fewer

# Where modules are not to be kept once compiled, each process that a test starts would compile all of starhold anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell that starts the tests in the background has them ignore interrupts, which some of them send.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("starhold", deadline=None, derandomize=True, max_examples=fewer(100, 4))
settings.load_profile("starhold")


def pytest_addoption(parser):
    parser.addoption("--workers", type=int, default=1, metavar="N", help="share whole files of tests among N processes")


def pytest_configure(config):
    config.pluginmanager.register(workers)
    if getattr(config, "cache", None) is not None:
        config.pluginmanager.register(workers.Stopwatch(config.cache))


def pytest_report_header():
    return f"drawn by STARHOLD_SEED={SEED}"


def pytest_terminal_summary(terminalreporter):
    # A quiet run has no header.
    if terminalreporter.stats.get("failed"):
        terminalreporter.write_line(f"What is drawn is drawn again by STARHOLD_SEED={SEED}.")


def pytest_sessionstart():
    """Look for garbage after all is read: what is read stays to the end."""
    gc.disable()


def pytest_collection_finish(session):
    """Leave what is loaded by now out of the collections of garbage, and keep what is proved in one folder of the run."""
    gc.collect()
    gc.freeze()
    # What is frozen does not count, so that by default all that tests have left would be gone through again and again.
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
    share(session.config._tmp_path_factory.getbasetemp() / "proofs")


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
        for remembered in (laws._installed, laws._of_body, laws._commands, parts.parts, parts.alone):
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
