"""Modes, reductions and growth rates have the same bits whatever BLAS, NumPy and C library choose by processor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from processors import on_every_processor


def hash_under(settings: dict[str, str]) -> str:
    script = [sys.executable, str(Path(__file__).with_name("portable.py"))]
    done = subprocess.run(script, env={**os.environ, **settings}, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture(scope="module")
def here() -> str:
    return hash_under({})


@on_every_processor
def test_bits_are_the_same_on_every_processor(settings: dict[str, str], here: str) -> None:
    assert hash_under(settings) == here
