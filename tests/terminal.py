"""Commands as a user types them, for the tests of several rooms."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def workflow(*words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a directory and return what it said and how it ended."""
    command = [sys.executable, "-m", "workflow", *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120)
