"""Structures and batches that several tests step: the heavy chain, the blade, others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workflow import models, schemes
from workflow.models import Cases, Harmonics, Rayleigh, Structure
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


def siconos_chain() -> Structure:
    """The chain of the Siconos trajectories."""
    return chain(nodes=20, mass=0.01, stiffness=1e6, damping=Rayleigh(0.0, 1e-5))


def blade(nodes: int = 20) -> Structure:
    """The blade of the example study."""
    model = models.load("blade")
    return model.assemble(
        model.Parameters(
            nodes=nodes,
            length=0.04,
            width=0.03,
            thickness=1e-3,
            density=4430,
            specific_heat=560,
            conductivity=7.0,
            convection=400,
            expansion=9e-6,
            tip_stiffness=1e6,
            damping=Rayleigh(10.0, 2e-7),
        )
    )


def cases(structure: Structure, count: int = 1, **values: Any) -> Cases:
    """Return a batch; scalars are spread over cases and nodes, lists of cases are taken as they are.

    Harmonics are lists of [amplitude, frequency, phase], each a scalar or one value per case.
    """

    def of_case(name: str) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(values.get(name, 0.0), dtype=float), (count,)))

    def of_node(name: str, size: int) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(values.get(name, 0.0), dtype=float), (count, size)))

    def sinusoids(name: str) -> Harmonics:
        rows = [[np.broadcast_to(value, (count,)) for value in one] for one in values.get(name, [])]
        return Harmonics(*np.array(rows, dtype=float).reshape(len(rows), 3, count).transpose(1, 2, 0))

    n, m = structure.mechanical_size, structure.thermal_size
    names = ("e", "alpha", "gap", "mean", "amplitude", "frequency", "phase", "friction")
    harmonics = ("load_harmonics", "casing_harmonics")
    unknown = set(values) - {*names, *harmonics, "steady", "heating", "displacement", "velocity", "temperature"}
    if unknown:
        raise TypeError(f"no such condition: {unknown}")
    return Cases(
        **{name: of_case(name) for name in names},
        steady=of_node("steady", n),
        heating=of_node("heating", m),
        displacement=of_node("displacement", n),
        velocity=of_node("velocity", n),
        temperature=of_node("temperature", m),
        **{name: sinusoids(name) for name in harmonics},
    )


def sampling(duration: float, interval: float) -> Sampling:
    return Sampling(duration, interval, round(duration / interval) + 1)


def step(
    structure: Structure, batch: Cases, h: float, over: Sampling, method: str = "moreau", **options: Any
) -> Results:
    """Run a batch with one scheme."""
    scheme = schemes.load(method)
    return scheme.compute(scheme.init(structure, h, scheme.Options(**options)), batch, over)


def blade_rub(structure: Structure, **values: Any) -> Cases:
    """The abstract's scene: the blade rubs over ten load periods of 0.2 s."""
    rub = {"alpha": 30.0, "gap": 20e-6, "amplitude": 24.0, "frequency": 5.0}
    return cases(structure, **{**rub, **values})


def alone(batch: Cases, case: int) -> Cases:
    """Return one case of a batch."""
    return batch.take(slice(case, case + 1))


def same_bits(a: Results, b: Results) -> bool:
    """Tell whether two results agree in every bit of every array (NaN equal to NaN)."""
    arrays = [(a.histories[name], b.histories[name]) for name in a.histories]
    arrays += [(a.metrics[name], b.metrics[name]) for name in a.metrics]
    arrays += [(getattr(a, n), getattr(b, n)) for n in ("period_impulse", "period_temperature", "period_contact")]
    return all(x.tobytes() == y.tobytes() for x, y in arrays) and np.array_equal(a.status, b.status)


def taken(results: Results, which: slice) -> Results:
    """Return the results of some cases."""
    return replace(
        results,
        histories={name: values[which] for name, values in results.histories.items()},
        metrics={name: values[which] for name, values in results.metrics.items()},
        period_impulse=results.period_impulse[which],
        period_temperature=results.period_temperature[which],
        period_contact=results.period_contact[which],
        status=results.status[which],
    )


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 distance of a from b."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))
