"""Structures and batches that several tests step: the heavy chain, the blade, others."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workflow import models, schemes
from workflow.declare import File
from workflow.models import (
    Array,
    Cases,
    Chain,
    Coating,
    Coordinates,
    DensePair,
    Harmonics,
    Matrices,
    Rayleigh,
    Sensors,
    Structure,
    at_rest,
    structure_from_matrices,
)
from workflow.models._from_matrices import with_contacts
from workflow.models._matrix_entries import Chosen, given_by
from workflow.schemes import Results, Sampling


def chain(**parameters: Any) -> Structure:
    """Assemble a chain; heat capacity 1 where a scene has no heat."""
    model = models.load("chain")
    return model.assemble(model.Parameters(**{"heat_capacity": 1.0, **parameters}))


def heavy_chain(**parameters: Any) -> Structure:
    """The chain that benchmarks use."""
    lumps = {
        "nodes": 20,
        "mass": 2.5e-3,
        "stiffness": 2.0e7,
        "damping": Rayleigh(10.0, 2.0e-7),
        "spacing": 2.5e-3,
        "expansion": 8.6e-6,
        "heat_capacity": 1.315,
        "conductance": 0.605,
        "convection": 0.02,
    }
    return chain(**{**lumps, **parameters})


def finer_chain(nodes: int) -> Structure:
    """The heavy chain in so many nodes, with the same total mass, stiffness, capacity and conductance."""
    share = nodes / 20
    return heavy_chain(
        nodes=nodes, mass=2.5e-3 / share, stiffness=2e7 * share, spacing=2.5e-3 / share,
        heat_capacity=1.315 / share, conductance=0.605 * share, convection=0.02 / share,
    )  # fmt: skip


def siconos_chain() -> Structure:
    """The chain of the Siconos trajectories."""
    return chain(nodes=20, mass=0.01, stiffness=1e6, damping=Rayleigh(0.0, 1e-5))


def blade(nodes: int = 20, **parameters: Any) -> Structure:
    usual = {"length": 0.04, "width": 0.03, "thickness": 1e-3, "density": 4430, "specific_heat": 560}
    usual |= {"conductivity": 7.0, "convection": 400, "expansion": 9e-6, "tip_stiffness": 1e6}
    usual |= {"nodes": nodes, "damping": Rayleigh(10.0, 2e-7)}
    model = models.load("blade")
    return model.assemble(model.Parameters(**{**usual, **parameters}))


def of_file(path: Path, model: str = "matrices", **parameters: Any) -> Structure:
    kind = models.load(model)
    return kind.assemble(kind.Parameters(File(str(path), path.name, str(path)), **parameters))


def of_entries(entries: dict[str, Any], damping: Rayleigh | None = None, build: Any = structure_from_matrices) -> Any:
    """Build the structure of a file's entries, with a row for each contact."""
    given, contacts = given_by(entries, Chosen(), damping or Rayleigh())
    return with_contacts(build(given), contacts)


def cases(structure: Structure, count: int = 1, **values: Any) -> Cases:
    """Return a batch; scalars are spread over cases and nodes, lists of cases are taken as they are.

    Harmonics are lists of [amplitude, frequency, phase], each a scalar or one value per case; amplitude, frequency and
    phase alone are the first of the load. ``gaps`` are those of several contacts, with ``turns`` of their harmonics.
    """
    return _cases((structure.mechanical_size, structure.thermal_size), count, values)


def static_equilibrium(
    structure: Structure, load: Array, heating: Array, gap: Any, friction: float = 0.0
) -> tuple[Array, Array]:
    """Return displacement and temperature at rest under constant loads."""
    gaps = np.broadcast_to(gap, (structure.contacts.count,))
    rest = at_rest(structure, cases(structure, steady=load, heating=heating, gaps=gaps, friction=friction))
    return rest.displacement[0], rest.temperature[0]


def tip_flexibility(structure: Structure) -> float:
    """Return S = e_nᵀ K1⁻¹ e_n, m/N; ``inf`` for a free root."""
    stiffness = structure.mechanical.tip_stiffness
    return 1 / stiffness if stiffness > 0 else float("inf")


def cases_of_file(structure: Structure, count: int = 1, **values: Any) -> Cases:
    """Return such a batch, given in the coordinates of the structure's file."""
    batch = _cases(structure.input_sizes, count, values)
    return batch if structure.coordinates is None else structure.coordinates.transformed(batch)


def _cases(sizes: tuple[int, int], count: int, values: dict[str, Any]) -> Cases:
    def spread(name: str, *shape: int) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(values.get(name, 0.0), dtype=float), (count, *shape)))

    def sinusoids(name: str, *first: list[Any]) -> Harmonics:
        rows = [[np.broadcast_to(value, (count,)) for value in one] for one in [*first, *values.get(name, [])]]
        return Harmonics(*np.array(rows, dtype=float).reshape(len(rows), 3, count).transpose(1, 2, 0))

    names, sine = ("e", "alpha", "mean", "friction"), ("amplitude", "frequency", "phase")
    lengths = dict.fromkeys(("steady", "displacement", "velocity"), sizes[0])
    lengths |= dict.fromkeys(("heating", "temperature"), sizes[1])
    unknown = set(values) - {*names, *sine, *lengths, "load_harmonics", "casing_harmonics", "gap", "gaps", "turns"}
    if unknown:
        raise TypeError(f"no such condition: {unknown}")
    own = {"gaps": spread("gap")[:, None]}
    if "gaps" in values:
        own["gaps"] = spread("gaps", np.shape(values["gaps"])[-1])
    if "turns" in values:
        own["turns"] = spread("turns", *np.shape(values["turns"])[-2:])
    return Cases(
        **{name: spread(name) for name in names},
        **{name: spread(name, size) for name, size in lengths.items()},
        load_harmonics=sinusoids("load_harmonics", [values.get(name, 0.0) for name in sine]),
        casing_harmonics=sinusoids("casing_harmonics"),
        **own,
    )


def sliding(structure: Structure, tangent: np.ndarray) -> Structure:
    """The structure with a casing that slides along ``tangent``, ``(mechanical,)``."""
    return replace(structure, contacts=replace(structure.contacts, tangent=np.array(tangent, dtype=float)[None]))


def observing(structure: Any, weights: np.ndarray | None) -> Any:
    """The structure of whose contact this mean of temperatures is recorded; that of the contact where ``None``."""
    return replace(structure, contacts=replace(structure.contacts, observed=None if weights is None else weights[None]))


def with_tip_first(structure: Structure) -> Matrices:
    """The structure in coordinates in reverse order, in which its one contact is no tip; ``received`` turns cases."""
    whole, given = structure.matrices(), [np.eye(n)[::-1] for n in (structure.mechanical_size, structure.thermal_size)]
    x, theta = given
    pairs = (
        DensePair(pair.inertia[::-1, ::-1], pair.weights, pair.deformation[:, ::-1])
        for pair in (whole.mechanical, whole.thermal)
    )
    own, sensors, none = whole.contacts, whole.sensors, (np.zeros(len(x)), np.zeros(len(theta)), np.zeros(len(x)))
    return replace(
        whole,
        **dict(zip(("mechanical", "thermal"), pairs, strict=True)),
        expansion=whole.expansion[:, ::-1],
        uniform_rise=whole.uniform_rise[::-1],
        damper=None if whole.damper is None else whole.damper[::-1, ::-1],
        load=whole.load if whole.load is None else whole.load[::-1],
        coordinates=Coordinates(x, x, theta, theta, *none),
        contacts=own.transformed(x, theta),
        sensors=sensors
        and replace(sensors, displacement=sensors.displacement @ x, temperature=sensors.temperature @ theta),
    )


def movable(batch: Cases) -> Cases:
    """The cases on a casing that could move: one kernel steps them and those of a casing that does."""
    still = Harmonics(*np.zeros((3, batch.count, 1)))
    return batch if batch.casing_harmonics.width else replace(batch, casing_harmonics=still)


def coated(structure: Structure, batch: Cases, yield_force: Any, sectors: Any = 1, **more: Any) -> Cases:
    """Return the batch with a coating, not worn: ``hardening``, ``speed``, a number or one for each case."""
    rows = [np.broadcast_to(value, (batch.count,)) for value in (yield_force, more.get("hardening", 0.0), sectors)]
    rows = [np.array(row, dtype=float) for row in (*rows, np.broadcast_to(more.get("speed", 0.0), (batch.count,)))]
    turns = np.tile(structure.contacts.angle / (2 * np.pi), (batch.count, 1))
    coating = Coating(*rows, turns, np.zeros((*turns.shape, int(rows[2].max()))))
    return replace(movable(batch), coating=coating)


def watched(structure: Structure) -> Structure:
    """The structure with sensors at its tip and of rows without any pattern, of displacements and of temperatures."""
    rng, contacts = np.random.default_rng(11), structure.contacts
    x, theta = np.zeros((4, structure.mechanical_size)), np.zeros((4, structure.thermal_size))
    x[0], theta[2] = contacts.normal[-1], contacts.heat[-1]
    x[1], theta[3] = rng.normal(size=x.shape[1]), rng.normal(size=theta.shape[1])
    shares = np.zeros((4, contacts.count))
    if contacts.is_massless:
        x[0], shares[0, -1] = 0.0, 1.0
    return replace(structure, sensors=Sensors(x, theta, shares))


def sampling(duration: float, interval: float, balances: bool = True) -> Sampling:
    """Return what is asked of cases; with balances, as in studies: one kernel serves most tests."""
    return Sampling(duration, interval, round(duration / interval) + 1, balances)


def step(
    structure: Structure, batch: Cases, h: float, over: Sampling, method: str = "moreau", **options: Any
) -> Results:
    scheme = schemes.load(method)
    return scheme.compute(scheme.init(structure, h, scheme.Options(**options)), batch, over)


def later(batch: Cases, results: Results, duration: float) -> Cases:
    """Return cases that start where those of a batch ended."""

    def turned(harmonics: Harmonics) -> Harmonics:
        return harmonics.turned((harmonics.frequency * duration) % 1.0)

    moved = {name: turned(getattr(batch, name)) for name in ("load_harmonics", "casing_harmonics")}
    return replace(batch, **results.end._asdict(), **moved)


def halves(
    structure: Structure, batch: Cases, h: float, over: Sampling, method: str, **options: Any
) -> tuple[Results, Results, Results]:
    """Return a motion, its first half, and what follows the end of that."""
    first = replace(over, duration=over.duration / 2, count=over.count // 2 + 1, ends=True)
    begun = step(structure, batch, h, first, method, **options)
    return (
        step(structure, batch, h, over, method, **options),
        begun,
        step(structure, later(batch, begun, first.duration), h, first, method, **options),
    )


def rubs(structure: Structure, count: int, **values: Any) -> Cases:
    """Random rubs of the heavy chain, as many load periods in each; every third has no heat, some share their α."""
    rng = np.random.default_rng(7)
    rub: dict[str, Any] = {
        "e": rng.uniform(0, 0.9, count),
        "alpha": np.where(np.arange(count) % 3 == 0, 0.0, np.repeat(rng.uniform(0, 50, count), 2)[:count]),
        "gap": rng.uniform(4e-5, 6e-5, count),
        "amplitude": rng.uniform(90, 110, count),
        "frequency": 20.0,
        "phase": rng.uniform(-0.5, 0.5, count),
    }
    return cases(structure, count, **{**rub, **values})


def blade_rub(structure: Structure, **values: Any) -> Cases:
    """The abstract's scene: the blade rubs over ten load periods of 0.2 s."""
    rub = {"alpha": 30.0, "gap": 20e-6, "amplitude": 24.0, "frequency": 5.0}
    return cases(structure, **{**rub, **values})


def everything_acts(structure: Structure, count: int = 1, **values: Any) -> Cases:
    """Cases with every load and initial state, which touch their casing many times."""
    rng = np.random.default_rng(1)
    n, m = structure.mechanical_size, structure.thermal_size
    acting = {
        "alpha": 30.0,
        "gap": 5e-5,
        "mean": 20.0,
        "amplitude": 100.0,
        "frequency": 200.0,
        "phase": 0.3,
        "steady": rng.normal(size=n),
        "heating": 10 * rng.normal(size=m),
        "temperature": rng.uniform(0, 3, m),
        "displacement": 1e-6 * rng.normal(size=n),
        "velocity": 1e-2 * rng.normal(size=n),
    }
    return cases(structure, count, **{**acting, **values})


WAVES = {
    "casing_harmonics": [[4e-6, 330.0, 0.4], [1.5e-6, 90.0, 2.0]],
    "load_harmonics": [[30.0, 410.0, 1.0], [12.0, 37.0, 0.2]],
}
"""Harmonics of a casing in motion and of its load."""


def with_dashpot(structure: Structure, first: int, second: int | None, strength: float) -> Matrices:
    """The structure with a dashpot between two nodes, or from one to the ground: it couples all modes."""
    along = np.zeros(structure.mechanical_size)
    along[first] = 1.0
    if second is not None:
        along[second] = -1.0
    return replace(structure.matrices(), damper=strength * np.outer(along, along))


def poles_in_contact(structure: Structure, closed: Any, alpha: float, friction: float = 0.0) -> np.ndarray:
    """Eigenvalues with contacts closed: x = Z q on the null space of w, or forces (R - µ R^t + c)⁻¹ (w x - r θ)."""
    c, n, heats = structure.contacts, structure.mechanical_size, structure.thermal_size
    inverse = np.linalg.inv(structure.mass)
    push = -inverse @ np.hstack([structure.stiffness_matrix, structure.damping_matrix, structure.coupling_matrix])
    W, onto = c.normal[closed], (c.normal - friction * c.tangent)[closed].T
    if c.is_compliant:
        basis = np.eye(n)
        bends = np.zeros((c.count, heats)) if c.residual_coupling is None else c.residual_coupling
        depth = np.hstack([W, np.zeros((len(W), n)), -bends[closed]])
        force = np.linalg.solve(c.compliance(friction)[np.ix_(closed, closed)], depth)
    else:
        basis = np.linalg.svd(W)[2][len(W) :].T
        force = np.linalg.solve(W @ inverse @ onto, W @ push)
    free, m = push - inverse @ onto @ force, basis.shape[1]
    into = np.zeros((2 * n + heats, 2 * m + heats))
    into[:n, :m], into[n : 2 * n, m : 2 * m], into[2 * n :, 2 * m :] = basis, basis, np.eye(heats)
    A = np.zeros((2 * m + heats, 2 * m + heats))
    A[:m, m : 2 * m], A[m : 2 * m] = np.eye(m), basis.T @ free @ into
    still = np.linalg.inv(structure.heat_capacity)
    A[2 * m :] = alpha * still @ c.heat[closed].T @ force @ into
    A[2 * m :, 2 * m :] -= still @ structure.conductance_matrix
    return np.linalg.eigvals(A)


def alone(batch: Cases, case: int) -> Cases:
    return batch.take(slice(case, case + 1))


def same_bits(a: Results, b: Results) -> bool:
    """Tell whether two results agree in every bit of every array (NaN equal to NaN)."""
    arrays = [(a.histories[name], b.histories[name]) for name in a.histories]
    arrays += [(a.metrics[name], b.metrics[name]) for name in a.metrics]
    arrays += [(getattr(a, n), getattr(b, n)) for n in ("period_impulse", "period_temperature", "period_contact")]
    return all(x.tobytes() == y.tobytes() for x, y in arrays) and np.array_equal(a.status, b.status)


def taken(results: Results, which: slice) -> Results:
    """Return the results of some cases, with as many columns of load periods as they have on their own."""
    periods = int(np.sum(~np.isnan(results.period_impulse[which]), axis=-1).max(initial=0))
    names = ("period_impulse", "period_temperature", "period_contact")
    return replace(
        results,
        histories={name: values[which] for name, values in results.histories.items()},
        metrics={name: values[which] for name, values in results.metrics.items()},
        **{name: getattr(results, name)[which, ..., :periods] for name in names},
        status=results.status[which],
    )


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 distance of a from b."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def metal_chain(rng: np.random.Generator, nodes: int, graded: bool = False) -> Chain:
    """Lumps of 0.1 to 100 g on springs of 1e5 to 1e8 N/m, all alike or ``graded``, each of its own."""
    own = nodes if graded else 1
    return chain(
        nodes=nodes,
        mass=np.broadcast_to(10 ** rng.uniform(-4, -1, own), nodes).tolist(),
        stiffness=np.broadcast_to(10 ** rng.uniform(5, 8, own), nodes).tolist(),
        damping=Rayleigh(float(rng.choice([0, 10, 100])), float(rng.choice([0, 2e-7]))),
        spacing=1e-2,
        expansion=1e-5,
        heat_capacity=10 ** rng.uniform(-1, 1),
        conductance=10 ** rng.uniform(-1, 1),
        convection=0.1,
    )
