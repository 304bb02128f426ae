"""Scenes that other programs solved; their numbers lie beside the tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from comparison import ROOT, SCENES, Row, relative, scene, solved

from workflow.declare import File
from workflow.models import load, mechanical_modes

CALCULIX = ROOT / "tests" / "models" / "calculix"
EXACT = 1e-9
"""Share to which two exact solvers agree after hundreds of events, each of which enlarges earlier rounding."""

STEPS, EVENTS = "rounding over 20 000 steps", "rounding over all events"


def farthest(ours: Any, theirs: Any) -> float:
    """Return the largest distance of two histories, over the largest value of theirs."""
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


@scene(
    "programs",
    "Siconos, step by step",
    "Siconos 4.4.0 (Moreau–Jean, LCP, activation forecast h/2); trajectories in `tests/data`",
    "truth/siconos_chain",
)
def siconos() -> list[Row]:
    """A chain of 20 nodes under 20 N at 50 Hz, h = 1e-5 s, 20 000 steps, no heat: `moreau` is the same discrete law."""
    chain, rows = solved("truth/siconos_chain"), []
    for k, (file, law) in enumerate({"theta1_e0": "θ = 1, e = 0", "theta0.5_e0.8": "θ = ½, e = 0.8"}.items()):
        with np.load(ROOT / "tests" / "data" / f"siconos_{file}.npz") as theirs:
            impulse = float(theirs["impulse_per_step"].sum())
            ours = chain.isel(law=k)
            ours_in_all = float(ours["contact_impulse"].squeeze())
            rows.append(relative(f"{law}: impulse [N s]", impulse, ours_in_all, EXACT, STEPS))
            for name in ("displacement", "velocity"):
                apart = farthest(ours[name].values.ravel(), theirs[name])
                rows.append(Row(f"{law}: largest distance in {name}, over its largest", 0, apart, EXACT, STEPS))
    return rows


@scene(
    "programs",
    "Frequencies of CalculiX",
    "CalculiX 2.20 (ARPACK); its matrices and table in `tests/models/calculix`",
)
def calculix() -> list[Row]:
    """Three hexahedra, plain and with incompatible modes, of which some have no mass: the matrices that it wrote have
    the frequencies that it printed.
    """
    model, rows = load("matrices"), []
    for elements in ("c3d8", "c3d8i"):
        file = CALCULIX / f"{elements}.sti"
        parameters = model.Parameters(File("", file.name, str(file)), contact="16.3", units="mm-t-s")
        frequencies = mechanical_modes(model.assemble(parameters)).values / (2 * np.pi)
        table = [line.split() for line in (CALCULIX / f"{elements}.frequencies.txt").read_text().splitlines()]
        printed = [float(row[3]) for row in table if row and row[0].isdigit()]
        for k, (known, here) in enumerate(zip(printed, frequencies[: len(printed)], strict=True)):
            half = 0.5001 * 10 ** (np.floor(np.log10(known)) - 6)
            rows.append(Row(f"{elements.upper()}: frequency {k + 1} [Hz]", known, here, half, "7 digits printed"))
    return rows


def with_entries(study: str, **entries: Any) -> xr.Dataset:
    """Return the results of a study with some entries of its matrices given, or replaced."""
    place, _, name = study.partition("/")
    own = SCENES[place] / f"{name}.npz"
    return solved(study, {**(np.load(own) if own.exists() else {}), **entries})


def of_exact(results: xr.Dataset, name: str) -> float:
    """Return a number of the exact scheme's case, of a history the last."""
    value = results[name].sel(scheme="event_driven") if "scheme" in results.dims else results[name]
    return float((value.isel(t=-1) if "t" in value.dims else value).squeeze())


@scene(
    "programs",
    "One contact, by an independent event solver",
    "an event-driven solver in 80-bit arithmetic, written apart from this code (Taylor propagators of "
    "order 20, Bernstein bisection)",
    "audit/hottest_moment",
    "audit/heated_without_capacity",
    "audit/free_root_hits_casing",
    "audit/massless_dashpot",
    "free/weak_ground",
)
def one_contact() -> list[Row]:
    """Small structures on which an earlier version of this program was wrong; the studies are in `tests/truth`."""
    hottest, warmed = solved("audit/hottest_moment"), with_entries("audit/hottest_moment", heating=np.full(2, 0.5))
    light, free = solved("audit/heated_without_capacity"), solved("audit/free_root_hits_casing")
    mass = np.load(SCENES["audit"] / "massless_dashpot.npz")["mass"]
    mass[1, 1] = 1e-6
    dashpot = with_entries("audit/massless_dashpot", mass=mass)
    spring = np.array([[1e6, -1e6], [-1e6, 1e6]])
    ground = {"mass": np.eye(2) / 100, "stiffness": spring, "damping": np.diag([1e-9, 0.0]), "contact": [0.0, 1.0]}
    weak = with_entries("free/weak_ground", **ground)
    numbers = [
        ("the hottest moment of a pressed tip [K]", 6.521667013224, of_exact(hottest, "max_temperature")),
        ("its temperature after 6 s [K]", 5.697016726177, of_exact(hottest, "temperature")),
        ("the same with heat loads: impulse [N s]", 13.78499023078, of_exact(warmed, "contact_impulse")),
        ("… the hottest moment [K]", 6.509184946667, of_exact(warmed, "max_temperature")),
        ("329 impacts without heat capacity: impulse [N s]", 0.0640458879963, of_exact(light, "contact_impulse")),
        ("… temperature after 0.2 s [K]", 1.606764362717, of_exact(light, "temperature")),
        ("a free body that hits once: impacts", 1, of_exact(free, "impacts")),
        ("… place after 2 ms [m]", -7.362006399559e-3, of_exact(free, "displacement")),
        ("… impulse [N s]", 0.0999838127, of_exact(free, "contact_impulse")),
        ("a dashpot on a mass of 1e-6 kg: impulse [N s]", 0.0908490061571892, of_exact(dashpot, "contact_impulse")),
        ("… place after 0.1 s [m]", -5.221466711969172e-4, of_exact(dashpot, "displacement")),
        ("two masses on a weak dashpot: place after 20 ms [m]", 1.2652566785403e-2, of_exact(weak, "displacement")),
    ]  # fmt: skip
    return [relative(what, known, here, EXACT, EVENTS) for what, known, here in numbers]


@scene(
    "programs",
    "Several contacts, by an independent event solver",
    "an event-driven solver in 80-bit arithmetic, written apart from this code (Taylor polynomials, "
    "Bernstein subdivision, Lemke's method)",
)
def several_contacts() -> list[Row]:
    """Two or three contacts with and without heat, friction and restitution; structures, studies and histories are in
    `tests/contacts/scenes`.
    """
    rows = []
    for path in sorted(SCENES["contacts"].glob("*.yaml")):
        name, ours = path.stem, solved(f"contacts/{path.stem}").squeeze()
        with np.load(path.with_name(f"{name}_exact.npz")) as theirs:
            impulse = float(theirs["contact_impulse"].sum())
            apart = farthest(ours["displacement"].values, theirs["displacement"])
        ours_in_all = float(ours["contact_impulse"].sum())
        rows.append(relative(f"`{name}`: impulse of all contacts [N s]", impulse, ours_in_all, EXACT, EVENTS))
        rows.append(Row(f"`{name}`: largest distance in displacement, over its largest", 0, apart, EXACT, EVENTS))
    return rows


@scene(
    "steady",
    "Grazing and doubling of a heated mass",
    "an independent integrator (matrix exponentials, bisection; multipliers by finite differences)",
    "truth/one_impact",
)
def one_impact() -> list[Row]:
    """A mass of 1 g strikes once per load period. Over the load its motion begins where the tip grazes, unstable, up to
    where its period doubles.
    """
    branch = solved("truth/one_impact")
    meanings = branch["bifurcation"].attrs["flag_meanings"].split()

    def first(name: str) -> float:
        return float(branch["amplitude"].where(branch["bifurcation"] == meanings.index(name)).min())

    place = "10 digits; a place on a branch is found to 1e-6"
    return [
        relative("load at grazing [N]", 7.517809028, first("grazing"), 1e-6, place),
        relative("load at the doubling [N]", 8.729449824, first("period_doubling"), 1e-6, place),
    ]


@scene(
    "heat",
    "Flutter below the critical coupling",
    "eigenvalues of the system with the tip held, by LAPACK",
    "hard/flutter",
)
def lapack() -> list[Row]:
    """The rod of four nodes in `studies/hard/flutter.yaml`: α_c is 0.5 m/s, and a complex pair grows before."""
    rates = solved("hard/flutter", **{"scene.duration": 1e-3, "axes.scheme": "moreau"})["growth_rate"].values.ravel()
    return [
        relative(f"growth rate at α = {alpha:g} m/s [1/s]", known, here, 1e-8, "9 digits")
        for alpha, known, here in zip((0, 0.1, 0.45), (-5.0, 117.481518, 540.475263), rates, strict=True)
    ]
