"""Structures of many degrees of freedom: sparse matrices that are factorised once and never become dense.

Nothing here steps such a structure: a basis of :mod:`workflow.reduction` reduces it first, and the quadratic forms
Xᵀ M X, Xᵀ K1 X, Xᵀ K12 Θ, Θᵀ C2 Θ, Θᵀ K2 Θ of its vectors are the matrices of the reduced structure. Up to
:data:`MOST_WITH_MATRICES` coordinates its dense matrices are made when something asks for them (``full``).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._chain_pair import MOST_NODES_WITH_MATRICES
from workflow.models._from_matrices import Forms, structure_of_forms
from workflow.models._sparse_pair import SparsePair, TooManyCoordinatesError
from workflow.models._structure import Coordinates, Matrices, Rayleigh, Structure


@dataclass(frozen=True, eq=False)
class Sparse(Structure):
    """Equations (1a) and (1b) by sparse matrices, the tip's coordinate last.

    There are no springs: where other structures have elongations there are the forces K1 x, where they have
    differences the heat flows K2 θ. The dense matrices of a :class:`~workflow.models.Structure` are made on demand.

    Attributes
    ----------
    mechanical
        K1 [N/m] and M [kg].
    thermal
        K2 [W/K] and C2 [J/K].
    coupling
        K12, N/K, ``(mechanical, thermal)``.
    damping
        Of the modes, or by Rayleigh's coefficients.
    tangent
        Direction in which the casing slides, ``(mechanical,)``; ``None`` for none.
    load
        Direction along which the load acts, ``(mechanical,)``; ``None`` for the tip.
    damper
        What C1 has beside that, N s/m, ``(mechanical, mechanical)``; ``None`` for nothing.
    coordinates
        Coordinates that loads and initial states are given in.
    """

    mechanical: SparsePair
    thermal: SparsePair
    coupling: scipy.sparse.csc_array
    damping: Rayleigh = field(default_factory=Rayleigh)
    tangent: Array | None = None
    load: Array | None = None
    damper: scipy.sparse.csc_array | None = None
    coordinates: Coordinates | None = None

    @property
    def has_matrices(self) -> bool:
        """Whether it is small enough for dense matrices."""
        return max(self.mechanical_size, self.thermal_size) <= MOST_NODES_WITH_MATRICES

    @property
    def has_massless_tip(self) -> bool:
        """Never: contact without mass is refused."""
        return False

    @property
    def mechanical_size(self) -> int:
        """Number of mechanical coordinates, the tip included."""
        return self.mechanical.size

    @property
    def thermal_size(self) -> int:
        """Number of thermal coordinates, the tip included."""
        return self.thermal.size

    @cached_property
    def _dense(self) -> Matrices:
        if not self.has_matrices:
            raise TooManyCoordinatesError(max(self.mechanical_size, self.thermal_size))
        forms = Forms(
            mass=self.mechanical.inertia.toarray(),
            stiffness=self.mechanical.stiffness.toarray(),
            coupling=self.coupling.toarray(),
            heat_capacity=self.thermal.inertia.toarray(),
            conductance=self.thermal.stiffness.toarray(),
            even_rise=self.even_rise,
            tip_growth=self.tip_growth,
            tangent=self.tangent,
        )
        damper = None if self.damper is None else self.damper.toarray()
        matrices = structure_of_forms(forms, self.damping)
        return replace(matrices, load=self.load, damper=damper, coordinates=self.coordinates)

    def matrices(self) -> Matrices:
        """Return the same structure by its dense matrices.

        Raises
        ------
        TooManyCoordinatesError
            They would be too large.
        """
        return self._dense

    def elongations(self, displacements: Array) -> Array:
        """Return K1 x, N, ``(mechanical, …)``: there are no springs to be elongated."""
        return np.asarray(self.mechanical.stiffness @ displacements)

    def differences(self, temperatures: Array) -> Array:
        """Return K2 θ, W, ``(thermal, …)``: there are no conductors."""
        return np.asarray(self.thermal.stiffness @ temperatures)

    def strains(self, deformation: Array) -> bool:
        """Tell whether forces K1 x are any."""
        return bool(deformation.any())

    def inertia_forces(self, accelerations: Array) -> Array:
        """Return M a, N, ``(mechanical, …)``."""
        return np.asarray(self.mechanical.inertia @ accelerations)

    def heat_contents(self, temperatures: Array) -> Array:
        """Return C2 θ, J, ``(thermal, …)``."""
        return np.asarray(self.thermal.inertia @ temperatures)

    def thermal_forces(self, temperatures: Array) -> Array:
        """Return -K12 θ, N, ``(mechanical, …)``."""
        return -np.asarray(self.coupling @ temperatures)

    def strain_energies(self, displacement: Array) -> Array:
        """Return terms whose sum is xᵀ K1 x, ``(mechanical,)``."""
        return displacement * self.elongations(displacement)

    def heat_losses(self, temperature: Array) -> Array:
        """Return terms whose sum is θᵀ K2 θ, ``(thermal,)``."""
        return temperature * self.differences(temperature)

    @cached_property
    def tip_growth(self) -> Array:
        """-e_nᵀ K1⁻¹ K12, m/K, ``(thermal,)``: K1⁻¹ e_n is ψ/σ."""
        answer = self.mechanical.constraint / self.mechanical.tip_stiffness
        return -np.asarray(self.coupling.T @ answer)

    @property
    def critical_alpha(self) -> float:
        """α_c = S/β, m/s; 0 where heat that cannot leave pushes the tip out, ``inf`` where heat pulls it back."""
        pushed = float(self.tip_growth @ self.thermal.constraint)
        if pushed <= 0:
            return float("inf")
        return self.thermal.tip_stiffness / (self.mechanical.tip_stiffness * pushed)

    @property
    def mass(self) -> Array:  # type: ignore[override]
        """M, kg, dense."""
        return self._dense.mass

    @property
    def springs(self) -> Array:  # type: ignore[override]
        """Springs of the dense matrices, N/m."""
        return self._dense.springs

    @property
    def elongation(self) -> Array:  # type: ignore[override]
        """Elongation of each spring of the dense matrices per displacement."""
        return self._dense.elongation

    @property
    def expansion(self) -> Array:  # type: ignore[override]
        """Free thermal elongation of each spring of the dense matrices, m/K."""
        return self._dense.expansion

    @property
    def heat_capacity(self) -> Array:  # type: ignore[override]
        """C2, J/K, dense."""
        return self._dense.heat_capacity

    @property
    def conductors(self) -> Array:  # type: ignore[override]
        """Conductors of the dense matrices, W/K."""
        return self._dense.conductors

    @property
    def difference(self) -> Array:  # type: ignore[override]
        """Temperature difference across each conductor of the dense matrices."""
        return self._dense.difference

    @property
    def even_rise(self) -> Array:  # type: ignore[override]
        """1 each, as the contact heats one temperature."""
        return np.ones(self.thermal_size)
