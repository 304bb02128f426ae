"""Modes, reductions and growth rates have the same bits whatever BLAS, NumPy and C library choose by processor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SETTINGS: tuple[dict[str, str], ...] = (
    {},
    {"OPENBLAS_CORETYPE": "Nehalem"},
    {"OPENBLAS_CORETYPE": "Haswell"},
    {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"},
    {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"},
)


def test_the_same_bits_under_every_setting() -> None:
    def digest(setting: dict[str, str]) -> str:
        script = [sys.executable, str(Path(__file__).with_name("portable.py"))]
        told = subprocess.run(script, env={**os.environ, **setting}, capture_output=True, text=True, check=True)
        return told.stdout.strip()

    assert len({digest(setting) for setting in SETTINGS}) == 1
