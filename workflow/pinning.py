"""One choice of machine code for linear algebra: x86-64 processors with AVX2 and FMA then give the same bits.

NumPy and SciPy have an OpenBLAS each, which chooses its kernels by the processor, and NumPy chooses its own loops.
"""

from __future__ import annotations

import os
import platform
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

CHOSEN = {
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",  # as NumPy names them since 2.4
}
"""Variables of the environment, which children inherit."""


def pin() -> None:
    """Make the choice where the environment has made none, before NumPy is imported.

    Where it cannot be made, elsewhere than on Linux on x86-64 with AVX2 and FMA, nothing is done.

    Raises
    ------
    RuntimeError
        NumPy is imported already, by the processor's own choice.
    """
    left = {name: value for name, value in CHOSEN.items() if name not in os.environ}
    if not left or not _has_avx2():
        return
    if "numpy" in sys.modules:
        raise RuntimeError("NumPy is imported already, whose choice stands: call workflow.pin() before it is")
    os.environ.update(left)


def _has_avx2() -> bool:
    """Tell whether this is Linux on x86-64 with AVX2 and FMA, as the choice asks for."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    words = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    return "avx2" in words and "fma" in words


@cache
def is_pinned() -> bool:
    """Tell whether this process computes by the choice, whoever made it."""
    import scipy.linalg  # noqa: F401  # loads the second OpenBLAS
    from threadpoolctl import threadpool_info

    features = import_module("numpy._core._multiarray_umath").__cpu_features__
    libraries = [library for library in threadpool_info() if library["user_api"] == "blas"]
    chosen = [library.get("architecture") == "Haswell" and library["num_threads"] == 1 for library in libraries]
    return all(chosen) and not any(features.get(name) for name in CHOSEN["NPY_DISABLE_CPU_FEATURES"].split())
