"""Environments in which a process computes as on another x86-64 processor: libraries leave out what it does not offer.

All of them at once is the oldest processor; one by one they tell which library a difference comes from.
"""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from functools import cache

import pytest

_ONE_BY_ONE = [
    {"OPENBLAS_CORETYPE": "SkylakeX"},
    {"OPENBLAS_CORETYPE": "Haswell"},
    {"OPENBLAS_CORETYPE": "Nehalem"},
    {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"},
    {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"},
]
_OLDEST = {name: value for settings in _ONE_BY_ONE for name, value in settings.items()}

on_every_processor = pytest.mark.parametrize(
    "settings",
    [
        pytest.param(_OLDEST, id="oldest"),
        *(pytest.param(each, id=" ".join(each.values()), marks=pytest.mark.slow) for each in _ONE_BY_ONE),
    ],
)
"""Decorator of a test that takes ``settings``, variables of the environment."""


def printed_here(source: str, file: str = "") -> str:
    """Return what a program prints in this process, which takes its processor as it is."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exec(compile(source, file, "exec"), {"__name__": "__main__", "__file__": file})
    return output.getvalue().strip()


def printed_under(settings: dict[str, str], *words: str) -> str:
    """Return what Python prints for a command line in an environment with the settings, each asked for once."""
    return _printed(tuple(settings.items()), words)


@cache
def _printed(settings: tuple[tuple[str, str], ...], words: tuple[str, ...]) -> str:
    command = [sys.executable, "-W", "ignore", *words]
    environment = {**os.environ, **dict(settings)}
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.strip()
