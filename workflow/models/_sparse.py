"""Structures of many degrees of freedom: sparse matrices that are factorised once and never become dense.

No scheme steps such a structure itself: a basis of :mod:`workflow.reduction` reduces it first, to the projections
Xᵀ M X, Xᵀ K1 X, Xᵀ K12 Θ, Θᵀ C2 Θ, Θᵀ K2 Θ on its vectors. A small one has dense matrices on request (``full``).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._from_matrices import structure_of_forms
from workflow.models._pair import TooManyCoordinatesError
from workflow.models._sparse_pair import MOST_REDUCED, SparsePair
from workflow.models._static import static_tip_growth
from workflow.models._structure import Coordinates, Matrices, Rayleigh, Structure


@dataclass(frozen=True, eq=False)
class Sparse(Structure):
    """Equations (1a) and (1b) by sparse matrices, the tip's coordinate last; the contact heats one temperature.

    Attributes are those of a :class:`~workflow.models.Structure`, ``expansion`` is -K12, N/K.
    """

    mechanical: SparsePair
    thermal: SparsePair
    expansion: scipy.sparse.csc_array
    damping: Rayleigh = field(default_factory=Rayleigh)
    tangent: Array | None = None
    load: Array | None = None
    damper: scipy.sparse.csc_array | None = None
    coordinates: Coordinates | None = None

    @property
    def uniform_rise(self) -> Array:  # type: ignore[override]
        """1 each."""
        return np.ones(self.thermal_size)

    @cached_property
    def _dense(self) -> Matrices:
        if not self.has_matrices:
            raise TooManyCoordinatesError(max(self.mechanical_size, self.thermal_size), MOST_REDUCED)
        mechanical, thermal = self.mechanical, self.thermal
        forms = (mechanical.inertia, mechanical.stiffness, -self.expansion, thermal.inertia, thermal.stiffness)
        return replace(
            structure_of_forms(*(form.toarray() for form in forms)),
            damping=self.damping,
            tip_growth=static_tip_growth(self),
            tangent=self.tangent,
            load=self.load,
            damper=None if self.damper is None else self.damper.toarray(),
            coordinates=self.coordinates,
        )

    def matrices(self) -> Matrices:
        """Return the same structure with dense matrices."""
        return self._dense
