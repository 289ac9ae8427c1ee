"""Commands run as a user's are, but in the process of the tests, which has loaded what they need."""

import contextlib
import gc
import io
import os
import signal
import subprocess
import sys
import warnings

from starhold.cli.main import run_command


def starhold(*words, cwd, code=None, **options):
    """What a command printed and its exit code, which must be `code` if given. With options of `subprocess.run` it runs in a
    process of its own."""
    if options:
        command = [sys.executable, "-m", "starhold", *words]
        done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, **options)
        assert code in (None, done.returncode), done.stderr
        return done
    out, err = io.StringIO(), io.StringIO()
    argv, handlers = sys.argv, {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    threshold, formatted, before = gc.get_threshold(), warnings.formatwarning, os.getcwd()
    os.chdir(cwd)
    sys.argv = ["starhold", *map(str, words)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("default")
            # The test runner gathers warnings, a command prints them.
            warnings.showwarning = lambda *told, **_: err.write(warnings.formatwarning(*told[:4]))
            ended = run_command()
    finally:
        os.chdir(before)
        sys.argv, warnings.formatwarning = argv, formatted
        gc.set_threshold(*threshold)
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert code in (None, ended), err.getvalue() or out.getvalue()
    return subprocess.CompletedProcess(words, ended, out.getvalue(), err.getvalue())
