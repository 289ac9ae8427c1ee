"""Processes that share the tests of a run, whole files each. They begin as copies of the one that collected, so test files,
and all the libraries that they need, are read once."""

import os
import pickle
import signal
import struct
import warnings
from selectors import EVENT_READ, DefaultSelector

import pytest

SIZE = struct.Struct("=I")
SECONDS = "starhold/seconds"
"""Where the cache keeps how long each file took in the last run."""


class Stopwatch:
    """Adds up how long the tests of each file take."""

    def __init__(self, cache):
        self.cache, self.seconds = cache, {}

    def pytest_runtest_logreport(self, report):
        file = report.nodeid.split("::")[0]
        self.seconds[file] = self.seconds.get(file, 0.0) + report.duration

    def pytest_sessionfinish(self):
        self.cache.set(SECONDS, self.cache.get(SECONDS, {}) | self.seconds)


class Sender:
    """Tells the first process of each test what a worker finds."""

    def __init__(self, config, pipe):
        self.config, self.pipe = config, pipe

    def tell(self, *what):
        content = pickle.dumps(what)
        self.pipe.write(SIZE.pack(len(content)) + content)
        self.pipe.flush()

    def pytest_runtest_logstart(self, nodeid, location):
        self.tell("begun", nodeid, location)

    def pytest_runtest_logreport(self, report):
        self.tell("report", self.config.hook.pytest_report_to_serializable(config=self.config, report=report))


def pytest_runtestloop(session):
    """Where several workers are asked for, have them run the tests."""
    count = session.config.getoption("workers")
    files = {}
    for item in session.items:
        files.setdefault(item.nodeid.split("::")[0], []).append(item)
    if min(count, len(files)) < 2 or session.testsfailed or session.config.option.collectonly:
        return None
    cache = getattr(session.config, "cache", None)
    seconds = cache.get(SECONDS, {}) if cache else {}
    # Those first that took longest in the last run: no worker is left with one at the end.
    longest = sorted(files.values(), key=lambda items: -seconds.get(items[0].nodeid.split("::")[0], 0.0))
    # A worker takes the next file by reading its number, which no other can read then.
    queue, fill = os.pipe()
    os.write(fill, b"".join(map(SIZE.pack, range(len(longest)))))
    os.close(fill)
    base = session.config._tmp_path_factory.getbasetemp()
    workers = {}
    for k in range(count):
        pipe, end = os.pipe()
        with warnings.catch_warnings():
            # Of threads that libraries keep for later.
            warnings.simplefilter("ignore", DeprecationWarning)
            process = os.fork()
        if not process:
            _work(session, longest, queue, end, base / f"worker{k}")
        os.close(end)
        workers[os.fdopen(pipe, "rb")] = process
    os.close(queue)
    try:
        _hear(session, workers)
    finally:
        for pipe, process in workers.items():
            pipe.close()
            os.kill(process, signal.SIGTERM)
            os.waitpid(process, 0)
    return True


def _hear(session, workers):
    """Report what workers tell until they are done."""
    config, left = session.config, {item.nodeid for item in session.items}
    if terminal := config.pluginmanager.getplugin("terminalreporter"):
        terminal.showfspath = False
    running, done = {}, set()
    with DefaultSelector() as selector:
        for pipe in workers:
            selector.register(pipe, EVENT_READ)
        while selector.get_map():
            for key, _ in selector.select():
                pipe = key.fileobj
                size = pipe.read(SIZE.size)
                if not size:
                    selector.unregister(pipe)
                    continue
                what, *more = pickle.loads(pipe.read(*SIZE.unpack(size)))
                if what == "begun":
                    running[pipe] = more
                    left.discard(more[0])
                elif what == "report":
                    report = config.hook.pytest_report_from_serializable(config=config, data=more[0])
                    config.hook.pytest_runtest_logreport(report=report)
                else:
                    done.add(pipe)
                if session.shouldfail:
                    raise session.Failed(session.shouldfail)
    for pipe in workers:
        if pipe not in done and pipe in running:
            nodeid, location = running[pipe]
            text = "the process that ran this test ended"
            report = pytest.TestReport(nodeid, location, {}, "failed", text, "call")
            config.hook.pytest_runtest_logreport(report=report)
    if left or len(done) < len(workers):
        raise session.Interrupted(f"{len(left)} tests were not run, because a worker ended before its last")


def _work(session, files, queue, end, folder):
    """Run files until none is left, and end."""
    config = session.config
    manager = config.pluginmanager
    code = 1
    try:
        capture = manager.getplugin("capturemanager")
        # The file that collects what tests print is otherwise one for all workers.
        capture.stop_global_capturing()
        capture.start_global_capturing()
        for one in [
            manager.getplugin("terminalreporter"),
            *filter(lambda p: isinstance(p, Stopwatch), manager.get_plugins()),
        ]:
            manager.unregister(one)
        folder.mkdir()
        config._tmp_path_factory._basetemp = folder
        with open(end, "wb") as pipe:
            sender = Sender(config, pipe)
            manager.register(sender)
            # A fixture of the run lives on if there is a next test.
            now = None
            for item in _taken(files, queue):
                if now is not None:
                    config.hook.pytest_runtest_protocol(item=now, nextitem=item)
                now = item
                if session.shouldfail or session.shouldstop:
                    break
            if now is not None:
                config.hook.pytest_runtest_protocol(item=now, nextitem=None)
            sender.tell("done")
        code = 0
    finally:
        os._exit(code)


def _taken(files, queue):
    """The tests of files that no other worker has taken."""
    while place := os.read(queue, SIZE.size):
        yield from files[SIZE.unpack(place)[0]]
