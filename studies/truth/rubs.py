"""Scenes of meshed structures: bars and beams that strike, heat that grows by pressure, a casing that wears."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import structures
from closed_forms import EXTRAPOLATED, ROUNDING, WIDTH, growth_rates
from comparison import TRUTH, Row, relative, scene, solved

from workflow.declare import File
from workflow.models import frequencies, load


def refined(
    study: str, made: Callable[[int], structures.Entries], coarse: int, number: Callable[[Any], Any], **settings: Any
) -> tuple[Any, Any, Any]:
    """Return a number on two meshes, the second twice as fine, and its limit: errors are of order 2."""
    first, second = (number(solved(study, made(cells), **settings)) for cells in (coarse, 2 * coarse))
    return first, second, second + (second - first) / 3


def growth(results: Any) -> Any:
    """Return growth rates, by alpha."""
    return results["growth_rate"].values.ravel()


@scene(
    "bars",
    "Two elastic bars collide",
    "code_aster, test SDNL111; d'Alembert",
    "truth/colliding_bars",
)
def colliding_bars() -> list[Row]:
    """A bar of steel (E = 2e11, ρ = 7800, L = 1 m, 2 cm square) at v = 1 m/s strikes an equal one, clamped at its far
    end. With c = √(E/ρ) they touch for 4 L/c, with the force ρ c S v/2 and the impulse 2 m v. 100 cells each.
    """
    bars = solved("truth/colliding_bars").squeeze()
    sound, mass = np.sqrt(2e11 / 7800), 7800 * 4e-4
    force, middle = np.diff(bars["impulse"]) / 1e-5, bars["t"].values[1:] - 5e-6
    inside = float(force[(middle > 1e-4) & (middle < 7e-4)].mean())
    return [
        relative("mean force [N]", mass * sound / 2, inside, 1e-6, WIDTH),
        relative("time in contact [s]", 4 / sound, float(bars["contact_time"]), 0.01, WIDTH),
        relative("impulse [N s]", 2 * mass, float(bars["contact_impulse"]), 0.01, WIDTH),
    ]


@scene(
    "bars",
    "A beam falls on a spring",
    "code_aster, test SDNL32, after Lo 1980",
    "truth/falling_beam",
)
def falling_beam() -> list[Row]:
    """A pinned beam (0.783 m, 14 mm square, E = 6.7e10, ρ = 2400, ζ = 1 %) turns at 3.8 rad/s and lands with its tip
    on a spring: deflection of the tip, by 10 elements and the spring as the flexibility of the casing.
    """
    published = {
        18: [2.66, 4.33, 4.92, 4.78, 3.82, 2.87, 2.71, 3.09, 3.41, 3.36, 2.64, 0.742],
        45: [2.25, 2.66, 1.96, 1.15, 0.124, 0.364, 2.01, 2.74, 1.89],
    }
    beams = solved("truth/falling_beam")["displacement"].squeeze()
    return [
        relative(
            f"{stiffness} kN/m, {t} ms: tip [mm]", known, 1e3 * float(beams[k, t]), 0.02, "published to some 1.5 %"
        )
        for k, (stiffness, all_known) in enumerate(published.items())
        for t, known in enumerate(all_known, start=1)
    ]


@scene(
    "heat",
    "A heated rod whose tip is cooled",
    "eigenvalues of the heat equation with the contact's heat, closed form",
    "truth/cooled_rod",
)
def cooled_rod() -> list[Row]:
    """The tip of the pressed rod loses heat to the wall, Bi times what the rod conducts per kelvin: α_c is at A = 2
    (1 + Bi), and z² cosh z + Bi z sinh z = A (cosh z − 1). Bi = 1, in units of the rod: L, E S, the expansion, the
    conductance and the heat capacity are 1, so that A = α.
    """
    *_, rates = refined("truth/cooled_rod", structures.cooled_rod, 50, growth)
    critical = float(solved("truth/cooled_rod")["critical_alpha"].max())
    return [
        relative("critical A", 4, critical, 1e-12, ROUNDING),
        *growth_rates({3: -1.0059011, 5: 0.9947536, 6: 1.9801281}, rates),
    ]


@scene(
    "heat",
    "Hot spots along a chord of contacts",
    "Burton 1980, in Jang, Khonsari, J. Tribol. 121 (1999) 648; Du et al., J. Thermal Stresses 20 (1997) 185",
    "truth/hot_spots",
)
def hot_spots() -> list[Row]:
    """A half-plane in plane stress is pressed on a rigid wall that slides: a pressure that varies with the wavelength
    2π/m grows above α_c = 2 m κ/(E a), as exp(s t), s = D m² (x² − 1), α/α_c = x (x + 1)/2. A quarter of a wavelength,
    symmetric at x = 0, antisymmetric at the other side, with α λ at each contact.
    """
    m = 2 * np.pi / structures.WAVELENGTH
    critical = 2 * m * structures.CONDUCTIVITY / (structures.MODULUS * structures.EXPANSION)
    unit = m**2 * structures.CONDUCTIVITY / (structures.DENSITY * structures.SPECIFIC_HEAT)

    def limits(results: Any) -> Any:
        return np.append(results["critical_alpha"].max(), growth(results))

    four, eight, limit = refined("truth/hot_spots", structures.hot_spots, 4, limits)
    rows = [
        relative("α_c by 4 contacts [W/N]", critical, four[0], 6e-3, WIDTH),
        relative("α_c by 8 contacts [W/N]", critical, eight[0], 1.5e-3, WIDTH),
        relative("α_c [W/N]", critical, limit[0], 1e-5, EXTRAPOLATED),
    ]
    for ratio, here in zip((0.8, 1.2, 1.5), limit[1:], strict=True):
        x = (np.sqrt(1 + 8 * ratio) - 1) / 2
        rows.append(relative(f"s/(D m²) at α/α_c = {ratio:g}", x**2 - 1, here / unit, 1e-4, EXTRAPOLATED))
    return rows


OSCILLATES = {0.1: 2.0813441, 0.5: 2.4069345, 1.0: 2.8143972, 2.0: 3.6308620}
"""A of the rod that wears at which an oscillation neither grows nor decays, by W."""


@scene(
    "heat",
    "A heated rod that wears its casing",
    "closed form; Dow, Burton, J. Lubr. Technol. 95 (1973) 71",
    "truth/worn_rod",
)
def worn_rod() -> list[Row]:
    """The pressed rod wears the casing by Archard's law, ẇ = κ_w λ: the casing is a coordinate on a dashpot 1/κ_w.
    With W = E S κ_w L/D it grows as exp(D z² t/L²), (z² + W) cosh z = A (cosh z − 1): wear keeps the force from growing
    steadily, but from some A on it oscillates. The growth rate there is 0; in units of the rod as above.
    """
    grows = {(2, 0.5): -0.2438684, (3, 1.0): 0.1098146, (6, 1.0): 2.8623903}
    rows = []
    for wear, a in OSCILLATES.items():
        others = {other: rate for (other, of), rate in grows.items() if of == wear}
        made = partial(structures.worn_rod, wear=wear)
        *_, here = refined("truth/worn_rod", made, 50, growth, **{"axes.alpha": [a, *others]})
        rows.append(Row(f"growth rate s L²/D at W = {wear:g}, A = {a:.8g}", 0, here[0], 2e-7, EXTRAPOLATED))
        for (other, rate), number in zip(others.items(), here[1:], strict=True):
            rows.append(relative(f"… at W = {wear:g}, A = {other}", rate, number, 1e-6, EXTRAPOLATED))
    return rows


@scene(
    "contacts",
    "A mass and a casing that it wears",
    "closed form; DOP853 of SciPy at 1e-12",
    "truth/worn_wall_impact",
    "truth/worn_wall",
)
def worn_wall() -> list[Row]:
    """Archard's law, ẇ = κ λ: the casing is a coordinate of 1e-6 kg on a dashpot 1/κ, the contact w = (1, −1), e = 0.
    A free mass m that comes with v₀ wears κ m v₀ (1 − exp(−t/(m κ))). A mass of 1 kg (k = 400 N/m, c = 2 N s/m, gap 1
    mm, 1 N at 3 Hz) rubs for 20 periods.
    """
    light = "mass of the casing"
    depth = solved("truth/worn_wall_impact")["sensor_value"].values.ravel()
    rows = [
        relative(f"worn after {t} ms by a free mass [m]", 2e-3 * -np.expm1(-t), depth[t], 1e-6, light) for t in (1, 3)
    ]
    for wear, known in {1e-4: 2.816506209e-4, 1e-3: 2.551218690e-3, 1e-2: 1.319557268e-2}.items():
        rubbed = solved("truth/worn_wall", structures.worn_wall(wear))["sensor_value"].values.ravel()
        rows.append(relative(f"worn in 20 periods at κ = {wear:g} m/(N s) [m]", known, rubbed[-1], 1e-7, light))
    return rows


@scene(
    "speed",
    "A cantilever that turns",
    "Wright, Smith, Thresher, Wang, J. Appl. Mech. 49 (1982) 197",
    "truth/rotating_beam",
)
def rotating_beam() -> list[Row]:
    """Flapwise bending, hub radius 0, over the speed, η = Ω √(m L⁴/(E I)), m per length: K1 + Ω² K_Ω with K_Ω of the
    tension at Ω = 1. 40 elements.
    """
    model, file = load("matrices"), TRUTH / "rotating_beam.npz"
    rows = []
    for eta, known in {0: 3.5160, 2: 4.1373, 4: 5.5850, 6: 7.3604, 8: 9.2568, 10: 11.2023}.items():
        parameters = model.Parameters(File("", file.name, str(file)), speed=eta / (2 * np.pi))
        here = frequencies(model.assemble(parameters))[0]
        rows.append(Row(f"ω₁ √(m L⁴/(E I)) at η = {eta}", known, here, 5.1e-5, "4 decimals published"))
    return rows
