"""Matrices of a plate as a blade for `own_…` and `worn_casing`: ``python plate.py`` writes them.

A flat blade of titanium, 60 mm long, 30 mm wide and 2 mm thick, in plane stress: bilinear rectangles, with two
displacements and a temperature at each node. Its root is clamped and cold. Its tip has three contacts.
"""

import numpy as np

import workflow

LENGTH, WIDTH, THICKNESS, ALONG, ACROSS = 0.060, 0.030, 0.002, 12, 6
YOUNG, POISSON, DENSITY = 114e9, 0.33, 4430.0
SPECIFIC_HEAT, CONDUCTIVITY, CONVECTION, EXPANSION = 560.0, 7.0, 400.0, 9.0e-6

a, b = LENGTH / ALONG, WIDTH / ACROSS
ELASTIC = YOUNG / (1 - POISSON**2) * np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
GAUSS = np.array([-1, 1]) / np.sqrt(3)
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])  # of an element: along the blade, along its chord


def element() -> tuple[np.ndarray, ...]:
    """Return mass, stiffness, coupling, heat capacity and conductance of one rectangle."""
    M, K, K12, C2, K2 = np.zeros((8, 8)), np.zeros((8, 8)), np.zeros((8, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    volume = THICKNESS * a * b / 4  # of a Gauss point
    for xi in GAUSS:
        for eta in GAUSS:
            shape = (1 + xi * CORNERS[:, 0]) * (1 + eta * CORNERS[:, 1]) / 4
            slope = np.array(
                [
                    CORNERS[:, 0] * (1 + eta * CORNERS[:, 1]) / 2 / a,
                    CORNERS[:, 1] * (1 + xi * CORNERS[:, 0]) / 2 / b,
                ]
            )
            N, B = np.kron(shape, np.eye(2)), np.zeros((3, 8))
            B[0, ::2], B[1, 1::2], B[2, ::2], B[2, 1::2] = slope[0], slope[1], slope[1], slope[0]
            warm = np.outer([EXPANSION, EXPANSION, 0], shape)
            M += DENSITY * volume * N.T @ N
            K += volume * B.T @ ELASTIC @ B
            K12 -= volume * B.T @ ELASTIC @ warm  # heat lengthens the blade
            C2 += DENSITY * SPECIFIC_HEAT * volume * np.outer(shape, shape)
            K2 += volume * (CONDUCTIVITY * slope.T @ slope + 2 * CONVECTION / THICKNESS * np.outer(shape, shape))
    return M, K, K12, C2, K2


def node(i: int, j: int) -> int:
    """Return the number of the node in row i from the root, column j along the chord."""
    return i * (ACROSS + 1) + j


nodes = (ALONG + 1) * (ACROSS + 1)
M, K, K12 = np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, nodes))
C2, K2 = np.zeros((nodes, nodes)), np.zeros((nodes, nodes))
parts = element()
for i in range(ALONG):
    for j in range(ACROSS):
        heat = np.array([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)])
        moves = np.stack([2 * heat, 2 * heat + 1], axis=1).ravel()
        for whole, part, rows, columns in zip(
            (M, K, K12, C2, K2), parts, (moves, moves, moves, heat, heat), (moves, moves, heat, heat, heat), strict=True
        ):
            whole[np.ix_(rows, columns)] += part

moving, warm = np.s_[2 * (ACROSS + 1) :], np.s_[ACROSS + 1 :]  # all but the root
tip = [node(ALONG, 0), node(ALONG, ACROSS // 2), node(ALONG, ACROSS)]
blade = {
    "mass": M[moving, moving],
    "stiffness": K[moving, moving],
    "coupling": K12[moving, warm],
    "contact": np.eye(2 * nodes)[[2 * k for k in tip]][:, moving],
    "load": np.eye(2 * nodes)[2 * tip[0] + 1][moving],  # along the chord, at the leading edge
}
thermal = {
    "heat_capacity": C2[warm, warm],
    "conductance": K2[warm, warm],
    "thermal_contact": np.eye(nodes)[tip][:, warm],
}
workflow.write_matrices("plate.npz", **blade, **thermal, contact_labels=["leading", "middle", "trailing"])

# The same blade and the casing that its leading edge wears: one more coordinate, which no spring holds
WEAR, CASING = 1e-5, 1e-6  # wear coefficient [m/(N s)], mass of the casing's coordinate [kg]
size = len(blade["mass"])
worn = {name: np.pad(blade[name], ((0, 1), (0, 1))) for name in ("mass", "stiffness")}
worn["mass"][-1, -1] = CASING
worn["damping"] = 2e-7 * worn["stiffness"]
worn["damping"][-1, -1] = 1 / WEAR
workflow.write_matrices(
    "worn_plate.npz",
    **worn,
    **{**thermal, "thermal_contact": thermal["thermal_contact"][:1]},
    coupling=np.pad(blade["coupling"], ((0, 1), (0, 0))),
    contact=np.append(blade["contact"][0], -1.0),  # the blade less the casing
    vectors={"WORN": np.eye(size + 1)[-1]},
)
