"""Chain of lumped masses and heat capacities: the structure of every model of lumps on a line.

Its stiffness K and inertia, with joints j, grounds g and the root u_0 = 0:

    (K u)_i = g_i u_i + j_i (u_i - u_{i-1}) - j_{i+1} (u_{i+1} - u_i).

Elimination from the root to the tip adds positive numbers only,

    b_i = g_i + j_i b_{i-1}/(j_i + b_{i-1}),   pivot_i = b_i + j_{i+1},   pivot_n = b_n,

with b_i the stiffness of node i and all before it towards the root and the surroundings: no digit is lost, σ = b_n, and
an unconstrained part is found by a pivot that is exactly zero. With the tip held its own pivot is left out. A factor
of the matrix K knows σ of 500 cells that grow a millionfold to 2e-8 only, and there is none where a chain conducts no
heat.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from workflow.declare import Values, quantity, speed
from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._cases import Cases
from workflow.models._from_matrices import structure_of_forms
from workflow.models._pair import MOST_FULL, DensePair, Modes, Pair, TooManyCoordinatesError, UnusableMatricesError
from workflow.models._structure import Matrices, Rayleigh, Structure

MOST_ONE_BY_ONE = 100
"""Modes of a long chain that are computed one by one: each costs a pass or two along it, and memory for its shape."""

_SHIFT = 1e-6
"""Shift of the eigenvalues over the largest λ: λ is then known to 1e-19 of the largest, while the slowest of 100 000
nodes lies at 1e-10 of it."""


@dataclass(frozen=True, eq=False)
class ChainPair(Pair):
    """Joints between neighbours, lumps and grounds of a chain, ``(node,)`` each."""

    joint: Array
    """k_i [N/m] or κ_i [W/K], the first one to the root."""
    lumps: Array
    """m_i [kg] or c_i [J/K]."""
    ground: Array
    """Conductances b_i to the surroundings, W/K; 0 for stiffness."""
    most_modes = MOST_ONE_BY_ONE

    @property
    def stiffness(self) -> Array:
        """K, ``(node, node)``."""
        return self.dense.stiffness

    @property
    def size(self) -> int:
        return self.joint.size

    @cached_property
    def weights(self) -> Array:  # type: ignore[override]
        """Joints, then grounds where there are any."""
        return np.concatenate([self.joint, self.ground]) if self.ground.any() else self.joint

    @cached_property
    def dense(self) -> DensePair:
        if self.size > MOST_FULL:
            raise TooManyCoordinatesError(self.size, MOST_ONE_BY_ONE)
        return DensePair(np.diag(self.lumps), self.weights, self.deformation_of(np.eye(self.size)))

    def inertia_of(self, u: Array) -> Array:
        return np.asarray((self.lumps * u.T).T)

    def deformation_of(self, u: Array) -> Array:
        """Return u_i - u_{i-1} of the joints, then u_i of the grounds where there are any."""
        joints = np.diff(u, axis=0, prepend=0.0)
        return np.concatenate([joints, u]) if self.ground.any() else joints

    def forces(self, deformation: Array) -> Array:
        """Return N_i - N_{i+1} for forces N_i in the joints, plus the flows to the grounds."""
        flows = (self.weights * deformation.T).T
        forces = flows[: self.size].copy()
        forces[:-1] -= flows[1 : self.size]
        return forces + flows[self.size :] if self.ground.any() else forces

    @cached_property
    def _grounded(self) -> Array:
        """b, ``(node,)``."""
        grounded, before = [], np.inf
        for joint, ground in zip(self.joint.tolist(), self.ground.tolist(), strict=True):
            if joint > 0:  # in series with all before it; the root is rigid
                joint *= before / (joint + before) if before < np.inf else 1.0
            before = ground + joint
            grounded.append(before)
        return np.array(grounded)

    @cached_property
    def _pivots(self) -> Array:
        """Pivots of the elimination from the root to the tip, ``(node,)``."""
        return np.asarray(self._grounded + np.append(self.joint[1:], 0.0))

    @cached_property
    def constraint(self) -> Array:  # type: ignore[override]
        """ψ_{i-1} = ψ_i j_i/pivot_{i-1} from the tip to the root."""
        ratios = np.divide(self.joint[1:], self._pivots[:-1], out=np.zeros(self.size - 1), where=self.joint[1:] > 0)
        return np.append(np.cumprod(ratios[::-1])[::-1], 1.0)[:, None]

    @cached_property
    def deformed(self) -> Array:  # type: ignore[override]
        """Differences ψ_i b_{i-1}/pivot_{i-1} of the joints, which keep their digits; then ψ of the grounds."""
        part = np.divide(self._grounded[:-1], self._pivots[:-1], out=np.ones(self.size - 1), where=self.joint[1:] > 0)
        joints = self.constraint * np.append(1.0, part)[:, None]
        return np.concatenate([joints, self.constraint]) if self.ground.any() else joints

    @property
    def tip_stiffness(self) -> float:
        return float(self._grounded[-1])

    def _unconstrained(self, held: bool = False) -> list[slice]:
        """Return the unconstrained parts of the chain."""
        parts = [slice(*ends) for ends in pairwise([*np.flatnonzero(self.joint == 0).tolist(), self.size])]
        return [part for part in parts if not np.any(self.ground[part]) and not (held and part.stop == self.size)]

    def rigid_motions(self, held: bool) -> Array:
        motions = np.zeros((self.size, len(self._unconstrained(held))))
        for k, part in enumerate(self._unconstrained(held)):
            motions[part, k] = 1.0
        return motions

    def solve(self, load: Array, held: bool = False) -> Array:
        """Return K⁻¹ f, ``(node,)``; the centre of mass of an unconstrained part stays at 0."""
        balanced = load.copy()
        for part in self._unconstrained(held):
            lumps = self.lumps[part]
            balanced[part] -= np.cumsum(load[part])[-1] / np.cumsum(lumps)[-1] * lumps
        joint, pivot, carried = [*self.joint.tolist(), 0.0], self._pivots.tolist(), balanced.tolist()
        for i in range(self.size - 1):
            if pivot[i] > 0:
                carried[i + 1] += joint[i + 1] / pivot[i] * carried[i]
        u, beyond = np.zeros(self.size), 0.0
        for i in range(self.size - 1 - held, -1, -1):
            beyond = (carried[i] + joint[i + 1] * beyond) / pivot[i] if pivot[i] > 0 else 0.0
            u[i] = beyond
        for part in self._unconstrained(held):
            u[part] -= np.dot(self.lumps[part], u[part]) / np.sum(self.lumps[part])
        return u

    def shifted_solver(self) -> Callable[[Array, float], Array]:
        return lambda load, shift: self._shifted(shift).solve(load, held=True)

    def _shifted(self, shift: float) -> ChainPair:
        return ChainPair(self.joint, self.lumps, self.ground + shift * self.lumps)

    def _singular(self, first: int, last: int, held: bool = False, **options: Any) -> Any:
        """Return singular values of B ``first`` to ``last``, ascending, and vectors unless ``options`` exclude them.

        B is bidiagonal with BᵀB = M^-½ K M^-½. The values are eigenvalues of [[0, Bᵀ], [B, 0]], which is tridiagonal
        with rows and columns of B interleaved, accurate to eps times the largest of them.
        """
        size = self.size - held
        root = np.sqrt(self._pivots)
        beside = np.divide(-self.joint[1:], root[:-1], out=np.zeros(self.size - 1), where=root[:-1] > 0)
        alternating = np.zeros(2 * self.size - 1)
        alternating[::2], alternating[1::2] = root / np.sqrt(self.lumps), beside / np.sqrt(self.lumps[1:])
        chosen = (size + first, size + last)
        from scipy.linalg import eigh_tridiagonal  # imported here: planning needs none of it

        return eigh_tridiagonal(
            np.zeros(2 * size), alternating[: 2 * size - 1], select="i", select_range=chosen, **options
        )

    def lowest(self, count: int, held: bool = False) -> Modes:
        """Return the lowest modes by :meth:`_singular`.

        All λ are shifted in between where a part is unconstrained: the eigenvectors of a double 0 would mix rows and
        columns of B.
        """
        if count == 0:
            return Modes(np.zeros(0), np.zeros((self.size, 0)))
        loose = bool(self._unconstrained(held))
        shift = _SHIFT * float(((self.ground + self.joint) / self.lumps).max() or 1.0) if loose else 0.0
        values, vectors = self._shifted(shift)._singular(0, count - 1, held)
        shapes = np.zeros((self.size, count))
        shapes[: self.size - held] = np.sqrt(2) * vectors[::2] / np.sqrt(self.lumps[: self.size - held, None])
        return Modes(np.maximum(values**2 - shift, 0.0), shapes)

    def modes(self, count: int | None = None, held: bool = False) -> Modes:
        if count is not None and count <= MOST_ONE_BY_ONE + 1 and self.size > MOST_BY_JACOBI:
            return self.lowest(count, held)
        return self.dense.modes(count, held)

    def _value(self, which: int) -> float:
        """Return λ of the mode ``which`` (from 0, ascending)."""
        return max(float(self._singular(which, which, eigvals_only=True)[0]), 0.0) ** 2

    def spectrum(self) -> Array:
        if self.size <= MOST_FULL:
            return self.dense.spectrum()
        return np.array([0.0 if self._unconstrained() else self._value(0), self.largest()])

    def largest(self) -> float:
        return self.dense.largest() if self.size <= MOST_BY_JACOBI else self._value(self.size - 1)


MOST_NODES = 200_000


@dataclass(frozen=True, eq=False)
class Chain(Structure):
    """n lumps in line, spring i joining nodes i-1 and i; node 0 is the clamped, cold root.

    Attributes
    ----------
    masses, heat_capacities, convection
        m_i [kg], c_i [J/K] and b_i [W/K] of the nodes 1 … n, shape (n,).
    springs, conduction
        k_i [N/m] and κ_i [W/K] of the springs 1 … n, shape (n,).
    free_expansion
        a ℓ_i, free thermal elongation of a spring per kelvin [m/K], shape (n,).
    lengths
        ℓ_i of the springs, m, shape (n,); empty where they are not known.
    angular_speed
        Ω at which the chain turns, rad/s.
    centrifugal
        Its constant load by that, N, shape (n,); ``None`` for none.
    """

    masses: Array
    springs: Array
    free_expansion: Array
    heat_capacities: Array
    conduction: Array
    convection: Array
    damping: Rayleigh = field(default_factory=Rayleigh)
    lengths: Array = field(default_factory=lambda: np.zeros(0))
    angular_speed: float = 0.0
    centrifugal: Array | None = None

    @cached_property
    def mechanical(self) -> Pair:  # type: ignore[override]
        """K1 and M; K1 - Ω² M of a chain that turns."""
        return self._springs if self.angular_speed == 0 else self._turning.mechanical

    @cached_property
    def _springs(self) -> ChainPair:
        return ChainPair(self.springs, self.masses, np.zeros(self.masses.size))

    @cached_property
    def _turning(self) -> Matrices:
        """The chain with a factor of K1 - Ω² M in the place of its springs, and the same thermal forces."""
        rest, mass = replace(self, angular_speed=0.0), np.diag(self.masses)
        stiffness = rest.stiffness_matrix - self.angular_speed**2 * mass
        return structure_of_forms(mass, stiffness, rest.coupling_matrix, self.heat_capacity, self.conductance_matrix)

    def received(self, cases: Cases) -> Cases:
        """Return cases with the centrifugal load."""
        return cases if self.centrifugal is None else replace(cases, steady=cases.steady + self.centrifugal)

    @cached_property
    def thermal(self) -> ChainPair:  # type: ignore[override]
        """K2 and C2."""
        return ChainPair(self.conduction, self.heat_capacities, self.convection)

    @cached_property
    def expansion(self) -> Any:
        """Free thermal elongation a ℓ_i (θ_{i-1} + θ_i)/2 of each spring per temperature, m/K."""
        if self.angular_speed > 0:
            return self._turning.expansion
        half = self.free_expansion / 2
        if self.has_matrices:
            return np.diag(half) + np.diag(half[1:], -1)
        return scipy.sparse.diags_array([half, half[1:]], offsets=[0, -1], format="csr")

    def mean_over(self, depth: float) -> Array:
        """Return the weights of the nodes, ``(node,)``, in the mean temperature over a depth [m] from the tip.

        It is linear between nodes. All lengths together are at least the depth.
        """
        beyond = np.append(np.cumsum(self.lengths[:0:-1])[::-1], 0.0)  # of each spring, towards the tip
        covered = np.clip(depth - beyond, 0.0, self.lengths)
        far = np.divide(covered**2, 2 * self.lengths, out=np.zeros(covered.size), where=self.lengths > 0)
        return np.asarray((covered - far + np.append(far[1:], 0.0)) / depth)

    @property
    def uniform_rise(self) -> Array:  # type: ignore[override]
        """1 at each node."""
        return np.ones(self.masses.size)


@dataclass(frozen=True)
class Spin:
    """Rotation at Ω = 2π speed: forces Ω² m_i (radius + z_i), z_i from the root, and K1 - Ω² M, without stiffening."""

    radius: float = quantity("m", "distance of the root from the axis of rotation", at_least=0)


def turned(chain: Chain, spin: Spin | None, revolutions: float) -> Chain:
    """Return a chain that points away from the axis about which it turns, at so many revolutions per second.

    Springs keep their stiffness: that the tension of a blade stiffens it across is not in this model.

    Raises
    ------
    UnusableMatricesError
        Ω is not below the first frequency at rest, so that K1 - Ω² M is not positive definite; or there are too many
        nodes.
    """
    if spin is None or revolutions == 0:
        return chain
    if chain.masses.size > MOST_FULL:
        raise UnusableMatricesError(f"turns, with {chain.masses.size} nodes", f"write at most {MOST_FULL}")
    angular = 2 * np.pi * revolutions
    load = angular**2 * chain.masses * (spin.radius + np.cumsum(chain.lengths))
    turning = replace(chain, angular_speed=angular, centrifugal=load)
    try:
        turning.mechanical  # noqa: B018  # is made of a factor, which there is of a definite matrix alone
    except UnusableMatricesError:
        critical = float(np.sqrt(chain.mechanical.modes(1).values[0])) / (2 * np.pi)
        problem = f"turns at {revolutions:.6g} rev/s, where K1 - Ω² M is not positive definite"
        raise UnusableMatricesError(problem, f"stay below {critical:.6g} rev/s, its first frequency") from None
    return turning


def depends_on_speed(parameters: Parameters) -> bool:
    """Tell whether the structure depends on the scene's speed."""
    return parameters.spin is not None


@dataclass(frozen=True)
class Parameters:
    """Lumps of the chain, root to tip; each a scalar or one value per node or spring."""

    nodes: int = quantity("1", "number of nodes, the tip included", at_least=1, at_most=MOST_NODES)
    mass: Values = quantity("kg", "lumped masses m_i", above=0, per="node")
    stiffness: Values = quantity("N/m", "spring stiffnesses k_i", at_least=0, per="spring")
    heat_capacity: Values = quantity("J/K", "lumped heat capacities c_i", above=0, per="node")
    damping: Rayleigh = field(default_factory=Rayleigh)
    spacing: Values = quantity("m", "rest lengths of the springs", default=0.0, at_least=0, per="spring")
    expansion: Values = quantity("1/K", "thermal expansion coefficient", default=0.0, per="spring")
    conductance: Values = quantity("W/K", "conduction through a spring", default=0.0, at_least=0, per="spring")
    convection: Values = quantity("W/K", "loss to the surroundings", default=0.0, at_least=0, per="node")
    heating: Values = quantity("W", "constant heat load", default=0.0, per="node")
    spin: Spin | None = field(default=None, metadata={"later": True})
    speed: float = speed()


def assemble(parameters: Parameters) -> Chain:
    """Return the structure of equations (1a) and (1b)."""
    n = parameters.nodes

    def each(value: Values) -> Array:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)).copy()

    chain = Chain(
        masses=each(parameters.mass),
        springs=each(parameters.stiffness),
        damping=parameters.damping,
        free_expansion=each(parameters.expansion) * each(parameters.spacing),
        heat_capacities=each(parameters.heat_capacity),
        conduction=each(parameters.conductance),
        convection=each(parameters.convection),
        lengths=each(parameters.spacing),
    )
    return turned(chain, parameters.spin, parameters.speed)
