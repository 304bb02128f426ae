"""Modes, reductions and growth rates have the same bits whatever BLAS, NumPy and C library choose by processor."""

from __future__ import annotations

import hashlib
from pathlib import Path

from processors import on_every_processor, printed_here, printed_under

SCRIPT = Path(__file__).with_name("portable.py")


@on_every_processor
def test_bits_are_the_same_on_every_processor(settings: dict[str, str]) -> None:
    here = printed_here(SCRIPT.read_text(encoding="utf-8"), str(SCRIPT))
    assert len(here) == hashlib.sha256().digest_size * 2
    assert printed_under(settings, str(SCRIPT)) == here
