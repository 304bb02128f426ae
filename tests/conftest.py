"""Tests mirror the package; what several of them need stands in ``scenes.py`` and ``studies.py``."""

import gc
import os
import signal
import sys
from typing import Any

import pytest

import workflow
from workflow.pinning import CHOSEN

try:
    workflow.pin()
    begin_again = False
except RuntimeError:  # a plugin of pytest has imported NumPy
    os.environ.update(CHOSEN)
    begin_again = True
"""Before NumPy is imported, here and in all processes that tests start: hashes of results are compared, and threads of
BLAS that wait for each other's core take most of the time of a plain scheme's small products."""

os.environ["PYTHONSAFEPATH"] = "1"
"""Processes that tests start import the package that the tests import, as installed, not the one in the directory they
are started in, whose kernels would be compiled once more."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="write the kept archives of data/ anew")
    parser.addoption("--kills", type=int, default=30, help="how often runs are killed at random moments")
    parser.addoption("--sequences", type=int, default=6, help="how many random sequences of commands are tried")
    parser.addoption("--first", type=int, default=0, help="seed of the first of these sequences")


def pytest_configure(config: pytest.Config) -> None:
    """Let commands under test be interrupted: jobs in the background of a shell ignore Ctrl-C, and so would they.

    Where NumPy was there first the same command begins again, in an environment that makes its choice.

    Garbage is looked for seldom: as often as Python does it takes a tenth of the time of a process that compiles and
    holds most libraries.
    """
    if begin_again:
        config.pluginmanager.getplugin("capturemanager").stop_global_capturing()
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    gc.set_threshold(50_000, 20, 20)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


LONG_NOTEBOOKS = ("steady_rub.ipynb",)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave notebooks that take long to the slow tests."""
    for item in items:
        if item.path.name in LONG_NOTEBOOKS:
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Have garbage looked for among what tests make alone, not among libraries and tests."""
    gc.freeze()


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile what most tests need, once, before the workers begin: else each of them would compile it."""
    config = session.config
    of_all_tests = config.args_source is pytest.Config.ArgsSource.TESTPATHS and not config.option.collectonly
    if of_all_tests and config.option.numprocesses and not hasattr(config, "workerinput"):
        compile_common()


def compile_common() -> None:
    """Compile in two processes; what kernels of a scheme share is translated once in the process that compiles them."""
    from workflow import schemes
    from workflow.solve._compile import KernelVariant, compile_scheme, compiled_ahead

    chosen: list[tuple[str, dict[str, Any], dict[str, bool]]] = [
        ("event_driven", {}, {"balances": True}),
        *(("moreau", {}, {"balances": balances}) for balances in (False, True)),
        ("moreau", {}, {"balances": True, "harmonics": True}),
        *(("moreau", {}, {"balances": True, "slides": True, "harmonics": waves}) for waves in (False, True)),
        *(("carpenter", {}, {"balances": balances}) for balances in (False, True)),
        ("penalty", {"integration": "implicit"}, {"balances": True}),
    ]
    variants = [
        KernelVariant(method, schemes.load(method).Options(**options), **kind) for method, options, kind in chosen
    ]
    helped = [variant for variant in variants if variant.method in ("event_driven", "moreau")]
    with compiled_ahead(helped):
        for variant in (variants[0], *reversed(variants[1:])):
            compile_scheme(variant)
