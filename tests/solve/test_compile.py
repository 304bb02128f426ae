"""Compilation ahead: by a helper process where there are several schemes, by the run itself where that fails."""

import os
import signal
import stat
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import typeof

from quick import quick
from terminal import alive, children, until
from workflow import schemes
from workflow.cases import arrange
from workflow.schemes._fixed import march
from workflow.solve import _compile as compilation
from workflow.solve import solve
from workflow.solve._compile import KernelVariant, compile_scheme, compiled_ahead
from workflow.solve._solve import kernel_variants

KILLED = """
import sys
from workflow import schemes
from workflow.solve._compile import KernelVariant, compiled_ahead

variants = [KernelVariant(name, schemes.load(name).Options(), balances=True) for name in ("moreau", "event_driven")]
with compiled_ahead(variants):
    print("begun", flush=True)
    sys.stdin.read()
"""


def variant_of(method: str) -> KernelVariant:
    return KernelVariant(method, schemes.load(method).Options(), balances=True)


@pytest.fixture
def unnoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing is known to be compiled, whatever is in the cache."""
    monkeypatch.setattr(compilation, "_note", lambda variant: tmp_path / variant.method)
    compile_scheme.cache_clear()
    return tmp_path


def executable(path: Path, script: str) -> str:
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


@pytest.mark.parametrize("script", ["exit 1", "kill -9 $$", "exec < /dev/null", None])
def test_a_scheme_whose_helper_fails_is_compiled_all_the_same(
    script: str | None, unnoted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing = executable(unnoted / "python", script) if script else str(unnoted / "missing")
    monkeypatch.setattr(sys, "executable", failing)
    with compiled_ahead([variant_of("event_driven"), variant_of("moreau")]):
        assert not (unnoted / "moreau").exists()
        compile_scheme(variant_of("moreau"))
    assert (unnoted / "moreau").exists()


def test_helpers_are_gone_when_the_run_is_over(unnoted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", executable(unnoted / "python", f"echo $$ > {unnoted}/pid; exec sleep 1000"))
    with suppress(KeyboardInterrupt), compiled_ahead([variant_of("event_driven"), variant_of("moreau")]):
        until(lambda: (unnoted / "pid").exists() and (unnoted / "pid").read_text().endswith("\n"))
        assert alive(int((unnoted / "pid").read_text()))
        raise KeyboardInterrupt
    assert not alive(int((unnoted / "pid").read_text()))


def test_helpers_end_when_the_run_is_killed(tmp_path: Path) -> None:
    """The pipe from it ends, however it died; what they were compiling is not there."""
    run = subprocess.Popen(
        [sys.executable, "-c", KILLED],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    with run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"begun\n"
        until(lambda: bool(children(run.pid)))
        (helper,) = children(run.pid)
        until(lambda: "main" in Path(f"/proc/{helper}/cmdline").read_text())
        time.sleep(1.0)  # into its compilation, which takes many times as long
        assert alive(helper)
        run.send_signal(signal.SIGKILL)
    until(lambda: not alive(helper))
    assert not list(tmp_path.rglob("event_loop.run_cases-*.nbc"))  # the kernel that takes long
    assert not list(tmp_path.rglob("*.compiled"))


def test_what_is_compiled_needs_no_process(unnoted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "_started", None)
    (unnoted / "moreau").touch()
    with compiled_ahead([variant_of("carpenter"), variant_of("moreau")]):
        pass
    monkeypatch.setattr(compilation, "_note", lambda *_: None)  # no lasting cache
    with compiled_ahead([variant_of("event_driven"), variant_of("carpenter")]):
        pass


def test_every_scheme_and_the_reference_have_kernels_of_their_own() -> None:
    springs = {"springs": {"method": "penalty", "integration": "implicit"}}
    study = quick({"scheme": ["moreau", "springs"]}, schemes=springs, reference={"scheme": "event_driven"})
    variants = kernel_variants(arrange(study))
    assert [variant.method for variant in variants] == ["moreau", "penalty", "event_driven"]
    assert variants[1].options.integration == "implicit"
    assert [variant.method for variant in kernel_variants(arrange(quick()))] == ["moreau"]


def test_words_among_the_options_have_a_kernel_of_their_own_and_numbers_have_none() -> None:
    moreau, penalty = schemes.load("moreau"), schemes.load("penalty")
    words = [KernelVariant("moreau", moreau.Options(theta=theta), True).words for theta in (0.5, 0.7, 1.0)]
    assert words[0] == words[1] == words[2]
    kinds = [
        KernelVariant("penalty", penalty.Options(integration=kind), True).words for kind in ("explicit", "implicit")
    ]
    assert kinds[0] != kinds[1]


@pytest.mark.parametrize(
    ("axes", "scene"),
    [
        ({}, {}),
        ({}, {"casing.flexibility": 1e-6}),
        ({}, {"casing.flexibility": 1e-6, "casing.coating": {"yield_force": 1.0}}),
        ({"reduction": "macneal", "mechanical_modes": 1}, {"chain.nodes": 3}),
    ],
    ids=["rigid", "elastic", "coated", "without mass"],
)
def test_what_is_compiled_ahead_is_what_cases_run(
    axes: dict[str, Any], scene: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds: list[Any] = []
    schemes.load("moreau")
    monkeypatch.setattr(march, "KERNELS", dict.fromkeys(march.KERNELS, lambda *given: kinds.append(typeof(given))))
    grid = arrange(quick({"e": 0.5, "alpha": 5.0, **axes}, scene=scene))
    (variant,) = kernel_variants(grid)
    compilation._run(variant)
    solve(grid, 0, np.arange(2))
    assert kinds[0] == kinds[-1]
