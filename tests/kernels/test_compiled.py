"""Functions of kernels: chosen by the type of their first argument, and linked as parts of one program."""

from __future__ import annotations

import pwd
from typing import Any, NamedTuple

import pytest

from workflow.kernels import compiled
from workflow.kernels.compiled import by_type, defines, inlined, kernel


class Never(NamedTuple):
    value: float


@by_type
def turns(law: Any) -> int:
    return 1


@defines(turns, Never)
def no_turns(law: Never) -> int:
    return 0


@inlined
def shared_by_both(x: float) -> float:
    return x + 1.0


@inlined
def called_first(x: float) -> float:
    return 2.0 * shared_by_both(x)


@inlined
def called_later(x: float) -> float:
    return 3.0 * shared_by_both(x)


@kernel
def both(law: Any, x: float) -> float:
    result = 0.0
    for _ in range(0, turns(law), 1):
        result += called_first(x)
    for _ in range(int(x)):
        result += called_later(x)
    return result


def test_a_part_is_linked_where_its_first_caller_is_left_out() -> None:
    """Without it the kernel would call nothing at an address of 0."""
    assert both(Never(0.0), 2.0) == 18.0


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def getpwuid(user: int) -> Any:
        raise KeyError(user)

    monkeypatch.setattr(pwd, "getpwuid", getpwuid)
    monkeypatch.setattr(compiled, "__file__", "/proc/none/compiled.py")  # an installation of someone else
    for name in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    assert compiled.directory_of.__wrapped__("workflow.kernels") is None
