"""Marches compiled for a contact law: by modes, by a dense matrix.

A kernel is kept with the module that has the law, whose imports numba's cache follows. It is compiled when it is first
called, for the type of law that it is given.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from workflow.kernels.compiled import defines, kept_with
from workflow.kernels.packs import align_stack
from workflow.models import Array
from workflow.schemes._fixed.balance import Account as ModalAccount
from workflow.schemes._fixed.contact import Law, respond
from workflow.schemes._fixed.dense_balance import Account as DenseAccount
from workflow.schemes._fixed.dense_march import DenseState, FreeStep, march_dense
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State

R = TypeVar("R", bound=Callable[..., tuple[float, float, float]])


class Kernels(NamedTuple):
    """Marches compiled for a contact law."""

    modes: Callable[..., None]
    matrices: Callable[..., None]


KERNELS: dict[type, Kernels] = {}
"""The marches of each contact law, by the type of its parameters."""


def _kernels_of(module: str) -> Kernels:
    """Return the marches of a module that has a contact law."""

    def march_modes(operator: Coefficients, law: Law, state: State, block: Block, account: ModalAccount | None) -> None:
        align_stack()
        march(operator, law, state, block, account)

    def march_matrices(
        free: FreeStep, law: Law, state: DenseState, block: Block, account: DenseAccount, loads: Array, first: int
    ) -> None:
        align_stack()
        march_dense(free, law, state, block, account, loads, first)

    return Kernels(*(kept_with(module, function) for function in (march_modes, march_matrices)))


def contact_law(kind: type[Any]) -> Callable[[R], R]:
    """Return a decorator: what follows is the contact law of a type of parameters, a named tuple.

    It is called as :func:`~workflow.schemes._fixed.contact.respond`, and may use what numba compiles.
    """

    def add(law: R) -> R:
        KERNELS[kind] = _kernels_of(law.__module__)
        return defines(respond, kind)(law)

    return add
