"""Marches compiled for a contact law.

A kernel is kept with the module that has the law, whose imports numba's cache follows. It is compiled when it is first
called, for the type of law that it is given.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from workflow.kernels.compiled import defines, kept_with
from workflow.kernels.packs import align_stack
from workflow.schemes._fixed.balance import Account
from workflow.schemes._fixed.contact import Law, respond
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State

R = TypeVar("R", bound=Callable[..., tuple[float, float, float]])


KERNELS: dict[type, Callable[..., None]] = {}
"""The march of each contact law, by the type of its parameters."""


def _kernel_of(module: str) -> Callable[..., None]:
    """Return the march of a module that has a contact law."""

    def march_cases(operator: Coefficients, law: Law, state: State, block: Block, account: Account | None) -> None:
        align_stack()
        march(operator, law, state, block, account)

    return kept_with(module, march_cases)


def contact_law(kind: type[Any]) -> Callable[[R], R]:
    """Return a decorator: what follows is the contact law of a type of parameters, a named tuple.

    It is called as :func:`~workflow.schemes._fixed.contact.respond`, and may use what numba compiles.
    """

    def add(law: R) -> R:
        KERNELS[kind] = _kernel_of(law.__module__)
        return defines(respond, kind)(law)

    return add
