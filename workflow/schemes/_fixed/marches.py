"""Marches compiled for the contact law of a scheme: by modes, by a dense matrix.

A kernel is kept with the module that has the law, whose imports numba's cache follows::

    KERNELS = kernels_of(__name__)

It is compiled when it is first called, for the type of law that it is given.
"""

from __future__ import annotations

from workflow.kernels.compiled import kept_with
from workflow.kernels.packs import align_stack
from workflow.models import Array
from workflow.schemes._fixed.balance import Account as ModalAccount
from workflow.schemes._fixed.contact import Kernels, Law
from workflow.schemes._fixed.dense_balance import Account as DenseAccount
from workflow.schemes._fixed.dense_march import DenseState, FreeStep, march_dense
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State


def kernels_of(module: str) -> Kernels:
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
