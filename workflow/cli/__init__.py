"""The command line: ``_studies`` and ``_archives`` hold the commands, ``_app`` puts them together.

``_words`` describes arguments that several commands share, ``_terminal`` writes to the terminal, ``_failures`` says
what an error means and which exit status it has, ``_stop`` ends a command at Ctrl-C or SIGTERM. Nothing heavy is
imported before a command needs it.
"""

from __future__ import annotations

import atexit
import gc
import os

TYPE_CHECKING = False
if TYPE_CHECKING:  # importing typing itself would lengthen the time before signals are heeded
    from typing import Any


GARBAGE = 300_000
"""Objects made and still there after which Python looks for cycles of garbage, 700 without it: imports and compilers
make many objects and leave next to no cycles."""


def main() -> None:
    """Entry point of the command ``workflow``."""
    if os.path.expanduser("~") == "~":
        _make_home()
    gc.set_threshold(GARBAGE)
    for name in [name for name in os.environ if name.startswith(("MPLBACKEND", "BOKEH_"))]:
        del os.environ[name]  # figures and pages are files here, whatever a shell asks of windows and servers
    if not os.environ.get("SOURCE_DATE_EPOCH", "0").isdecimal():
        del os.environ["SOURCE_DATE_EPOCH"]  # empty as build scripts leave it, numpy.f2py would fail by it
    atexit.register(gc.freeze)  # or Python looks through all objects for garbage when it ends
    from workflow.cli._stop import heed_signals
    from workflow.pinning import pin

    pin()
    heed_signals()
    from workflow.cli._app import run_application

    run_application()


def _make_home() -> None:
    """Give a user without a home, as containers have, one for the caches of libraries until the process ends."""
    import shutil
    import tempfile

    os.environ["HOME"] = tempfile.mkdtemp(prefix="workflow-")
    atexit.register(shutil.rmtree, os.environ["HOME"], ignore_errors=True)


def __getattr__(name: str) -> Any:
    """Make the application when it is asked for."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from workflow.cli._app import app

    return app
