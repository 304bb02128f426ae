"""Scenes whose answer is a formula, or a number in a publication."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from comparison import Row, relative, scene, solved
from scipy.optimize import brentq

ROUNDING, WIDTH = "rounding", "width of a cell"
EXTRAPOLATED = "width of a cell, two meshes extrapolated"


def growth_rates(known: Mapping[float, float], here: Iterable[float]) -> list[Row]:
    """Return the rows of growth rates of a heated rod, known by A."""
    return [
        relative(f"growth rate s L²/D at A = {a:g}", rate, ours, 1e-7, EXTRAPOLATED)
        for (a, rate), ours in zip(known.items(), here, strict=True)
    ]


@scene(
    "impacts",
    "A ball on a vibrating table",
    "momentum and Newton's law",
    "truth/ball_on_table",
)
def ball_on_table() -> list[Row]:
    """A ball on a table moving as a sin ωt strikes it once per period, T = 2π/ω, with the speed v = π g/ω; Newton's law
    asks for the table's velocity v (1 − e)/(1 + e), which fixes the phase ψ of the impact. Each impact carries m g T.
    e = 0.8, a = 80 µm, 50 Hz.
    """
    ball, omega, g, mass, e, a = solved("truth/ball_on_table"), 2 * np.pi * 50, 9.81, 0.01, 0.8, 80e-6
    speed = np.pi * g / omega
    psi = -np.arccos(-speed * (1 - e) / (1 + e) / (a * omega))
    place = a * np.sin(psi) - g * 0.02**2 / 8
    impulse, last = (float(ball[name].values.ravel()[-1]) for name in ("period_impulse", "displacement"))
    return [
        Row("impacts in 1 000 periods", 1000, float(ball["impacts"]), 0, "a count"),
        relative("impulse of the last period [N s]", 2 * mass * speed, impulse, 1e-9, ROUNDING),
        relative("place between the last impacts [m]", place, last, 1e-9, ROUNDING),
    ]


@scene(
    "impacts",
    "A valve between two stops, to its last bounce",
    "closed form; the scene is that of issue 3222 of OrdinaryDiffEq.jl, without its dry friction",
    "studies/valve",
)
def valve() -> list[Row]:
    """m x″ + k x = F₀ + F₁ sin Ωt from rest on the lower stop, e = 0.3: bounces on the upper stop, each lower than the
    one before, until the valve rests there. It leaves where F₀ + F₁ sin Ωt falls to k d, d the place of the stop. The
    impacts are roots of the closed form of each flight.
    """
    found = solved("studies/valve", **{"axes.scheme": "event_driven", "axes.e": 0.3, "scene.duration": 2e-3}).squeeze()
    m, k, stop = 0.0003361185937456267, 1488.578099595049, 1.016e-3
    mean, pulse, omega = 0.606413105, 2.033654851, 500 * np.pi
    natural, shake = np.sqrt(k / m), pulse / m / (k / m - omega**2)
    time, place, speed, hits = 0.0, 0.0, 0.0, []

    def flight(begun: float, x: float, v: float, t: float) -> tuple[float, float]:
        a = x - mean / k - shake * np.sin(omega * begun)
        b = (v - shake * omega * np.cos(omega * begun)) / natural
        cosine, sine = np.cos(natural * (t - begun)), np.sin(natural * (t - begun))
        moved = a * cosine + b * sine + mean / k + shake * np.sin(omega * t)
        return moved, natural * (b * cosine - a * sine) + shake * omega * np.cos(omega * t)

    while not hits or hits[-1][1] > 1e-4:
        push = (mean + pulse * np.sin(omega * time) - k * place) / m
        grid = time + (2 * abs(speed) / push if hits else 1e-3) * np.linspace(0.5, 4, 400)
        beyond = np.array([flight(time, place, speed, t)[0] > stop for t in grid])
        first = int(beyond.argmax())
        hit = brentq(
            lambda t, at=(time, place, speed): flight(*at, t)[0] - stop, grid[first - 1], grid[first], xtol=1e-18
        )
        approach = flight(time, place, speed, hit)[1]
        hits.append((hit, approach))
        time, place, speed = hit, stop, -0.3 * approach
    leaves = (np.pi - np.arcsin((k * stop - mean) / pulse)) / omega
    left = float(found["event_time"].where(found["event_kind"] == 2).min())
    (first, _), (last, slowest) = hits[0], hits[-1]
    times, speeds = found["event_time"].values, found["event_approach"].values
    count = len(hits)
    return [
        relative("first impact [s]", first, times[0], 1e-12, ROUNDING),
        relative(f"impact {count} [s]", last, times[count - 1], 1e-11, "rounding of the place, over that speed"),
        relative(
            f"speed before impact {count} [m/s]",
            slowest,
            speeds[count - 1],
            1e-6,
            "rounding of the place, over the bounces",
        ),
        relative("it leaves the stop [s]", leaves, left, 1e-12, ROUNDING),
    ]


@scene(
    "steady",
    "The vibro-impact oscillator of *Recipes for Continuation*",
    "Dankowicz, Schilder, SIAM 2013, example 15.2, computed there by COCO",
    "truth/vibro_impact",
    "truth/vibro_impact_grazing",
)
def recipes_for_continuation() -> list[Row]:
    """x″ + 0.1 x′ + x = A cos t with a stop at 1 and e = 0.8: from rest into the orbit at A = 1, and its multipliers.
    The steady motion 10 A sin t grazes at A = 0.1.
    """
    speed = solved("truth/vibro_impact")["period_impulse"].values.ravel()[-1] / 1.8
    steady = solved("truth/vibro_impact", **{"scene.duration": 13.0, "output": {"steady": True}})
    angle, modulus = float(steady["floquet_angle"]), float(steady["floquet_multiplier"])
    grazing = solved("truth/vibro_impact_grazing")["impacts"].values.ravel()
    printed = "12 digits published"
    return [
        Row("speed before an impact, after 99 periods", 1.695732937595, speed, 1e-11, printed),
        Row("speed after it", -1.356586350076, -0.8 * speed, 1e-11, printed),
        Row("multiplier, real part", -0.58429531, modulus * np.cos(angle), 5e-9, "8 digits published"),
        Row("multiplier, imaginary part", 0.00560035, modulus * abs(np.sin(angle)), 5e-9, "8 digits published"),
        Row("impacts at A = 0.1 − 1e-10", 0, grazing[0], 0, "a count"),
        Row("an impact at A = 0.1 + 1e-10 (1: yes)", 1, float(grazing[1] > 0), 0, "a count"),
    ]


@scene(
    "steady",
    "The impact oscillator of Shaw and Holmes",
    "J. Sound Vib. 90 (1983) 129–155, closed form",
    "truth/impact_oscillator",
    "truth/period_doubling",
)
def shaw_holmes() -> list[Row]:
    """x″ + x = cos ωt with a stop at 0 and e = 0.8. At ω = 2 the free half period is that of the load. At
    ω = 2.653347727855 the period doubles: deviations of the impulse alternate.
    """
    struck = solved("truth/impact_oscillator")["period_impulse"].values.ravel()
    doubling = solved("truth/period_doubling")["period_impulse"].transpose("frequency", "period", ...)
    changes = np.diff(doubling.values.reshape(3, -1)[1])
    return [
        relative("speed before an impact at ω = 2, after 49 periods", 20 / 3, struck[-1] / 1.8, 1e-12, ROUNDING),
        Row("multiplier at ω = 2.653347727855", -1, changes[-1] / changes[-2], 1e-6, "ω to 12 digits"),
    ]


@scene(
    "steady",
    "One impact in n load periods, over the gap",
    "closed form, after Shaw and Holmes 1983",
    "truth/impacts_every_n",
)
def impacts_every_n() -> list[Row]:
    """x″ + 0.02 x′ + x = F sin ωt with a stop at d and e = 0.5. A motion with one impact of speed v in n load periods
    has d = v G_x + √(x̂² − v² (1 − G_v)²/ω²), x̂ the amplitude without a stop and G v the free motion that the
    impacts add: half an ellipse over the gap, with a fold where the gap is largest. ω = 1.8, 3.8, 5.8, followed from
    d = 0.
    """
    branches = solved("truth/impacts_every_n")
    rows = []
    for k, n in enumerate((1, 2, 3)):
        branch, omega = branches.isel(order=k), 2 * n - 0.2
        span, pole = 2 * np.pi * n / omega, complex(-0.01, np.sqrt(1 - 0.01**2))
        turn = np.exp(pole * span)
        # h is the free motion that an impact of unit approach speed adds: h(0) = h(span), h'(0) = h'(span) - (1 + e)
        matrix = [[(1 - turn).real, -(1 - turn).imag], [(pole * (1 - turn)).real, -(pole * (1 - turn)).imag]]
        z = complex(*np.linalg.solve(matrix, [0.0, -1.5]))
        place, speed = z.real, (pole * z).real + 1.5
        largest = (omega**2 - 1) / abs(1 - omega**2 + 0.02j * omega)  # amplitude of the linear response
        fold = largest * np.hypot(1, place * omega / (1 - speed))
        fold_flag, grazing_flag = (
            branch["bifurcation"].attrs["flag_meanings"].split().index(name) for name in ("fold", "grazing")
        )
        v = (branch["steady_impulse"] / 1.5 * n).where(branch["bifurcation"] != grazing_flag, 0.0)  # else √rounding
        once = (branch["steady_impacts"] * n).round() == 1
        off = np.hypot(branch["gap"] - v * place, v * (1 - speed) / omega) / largest - 1
        here, farthest = (
            float(branch["gap"].where(branch["bifurcation"] == fold_flag).max()),
            float(abs(off.where(once)).max()),
        )
        rows.append(relative(f"n = {n}: gap of the fold", fold, here, 1e-9, ROUNDING))
        rows.append(Row(f"n = {n}: distance of all points from the ellipse", 0, farthest, 1e-9, ROUNDING))
    return rows


@scene(
    "bars",
    "The impact of an elastic bar",
    "Doyen, Ern, Piperno, SIAM J. Sci. Comput. 33 (2011)",
    "truth/impact_bar",
)
def impact_bar() -> list[Row]:
    """A bar (E = 900, ρ = 1, L = 10) hits a wall at 10: by d'Alembert the wall bears ρ c v = 300 for 2 L/c = 2/3, and
    the bar leaves undeformed with −10. A chain of 41 nodes gives this within the width of a cell.
    """
    bars, rows = solved("truth/impact_bar"), []
    for scheme in bars["scheme"].values:
        bar = bars.sel(scheme=scheme)
        impulse, t = bar["impulse"].values.ravel(), bar["t"].values
        force, middle = np.diff(impulse) / 5e-3, t[1:] - 2.5e-3
        inside = force[(middle > 0.1) & (middle < 0.6)].mean()
        rows += [
            relative(f"`{scheme}`: mean force", 300, inside, 1e-3, WIDTH),
            Row(f"`{scheme}`: time in contact", 2 / 3, float(bar["contact_time"].squeeze()), 0.025 / 3, WIDTH),
            Row(f"`{scheme}`: speed in the end", -10, 10 - impulse[-1] / 10, 0.3, "energy of half a cell"),
        ]
    return rows


@scene(
    "impacts",
    "A ball that comes to rest",
    "momentum and Newton's law",
    "hard/ball",
)
def ball_at_rest() -> list[Row]:
    """A ball of 1 kg dropped from 1 m, e = 0.9: the first impact, at √(2H/g), carries (1 + e) √(2 g H). Its impacts
    accumulate at √(2H/g) (1 + e)/(1 − e) = 8.579 s; then it rests. In the whole time T the table bears m g T.
    """
    ball = solved("hard/ball", **{"axes.scheme": "event_driven", "axes.h": 1e-3}).squeeze()
    first = float(ball["impulse"].sel(t=0.46, method="nearest"))
    return [
        relative("impulse of the first impact [N s]", 1.9 * np.sqrt(2 * 9.81), first, 1e-9, ROUNDING),
        relative("impulse in 10 s [N s]", 98.1, float(ball["contact_impulse"]), 1e-9, ROUNDING),
        relative("force at rest [N]", 9.81, float(ball["contact_force"][-1]), 1e-9, ROUNDING),
    ]


@scene(
    "bars",
    "A clamped bar released against its wall",
    "d'Alembert; the shares of the energy by an implementation written apart from this code, at the same step",
    "hard/clamped_bar",
)
def clamped_bar() -> list[Row]:
    """A bar of unit length, compressed by a half and released: its end touches the wall for a third of each period of
    3, with the force 1/2, and nothing is lost. 100 nodes and 2 400 steps, θ = ½ and θ = 1.
    """
    schemes = ["event_driven", "midpoint", "implicit_euler"]
    bars = solved("hard/clamped_bar", **{"axes.scheme": schemes}).squeeze()
    touched = bars["contact_force"].sel(t=(bars["t"] > 1.1) & (bars["t"] < 1.9))
    rows = [
        relative(f"`{scheme}`: mean force while touched", 0.5, float(touched.sel(scheme=scheme).mean()), 1e-3, WIDTH)
        for scheme in schemes[:2]
    ]
    for scheme, known in (("midpoint", 0.990), ("implicit_euler", 0.487)):
        bar = bars.sel(scheme=scheme)
        velocity, impulses = bar["velocity"].values, np.diff(bar["impulse"].values)
        taken = float(np.sum(impulses * (velocity[1:] + velocity[:-1]) / 2)) / (1 / 8)
        kept = 1.0 + float(bar["energy_residual"]) - taken
        rows.append(Row(f"`{scheme}`: share of the energy after 4 periods", known, kept, 1e-3, "3 digits"))
    return rows


@scene(
    "contacts",
    "A mass on a casing that slides",
    "Newton's law and statics along n − µt",
    "truth/sliding_impact",
    "truth/sliding_rest",
)
def sliding_casing() -> list[Row]:
    """The contact force acts along n − µt. A mass with M = [[1, m], [m, 1]], m = 0.4, that arrives with u = 2 receives
    (1 + e) u (1 − m²)/(1 + µm), e = 0.6. Pressed on springs k = 100 with c = −30 between them, its contact bears
    (F − k d + c² d/k)/(1 + µ c/k).
    """
    struck, rests = (solved(f"truth/{name}").sel(scheme="event_driven") for name in ("sliding_impact", "sliding_rest"))
    rows = []
    for mu in struck["coefficient"].values:
        impulse = float(struck["contact_impulse"].sel(coefficient=mu).isel(h=0).squeeze())
        known = 1.6 * 2 * (1 - 0.4**2) / (1 + 0.4 * mu)
        rows.append(relative(f"impulse at µ = {mu:g} [N s]", known, impulse, 1e-12, ROUNDING))
    for mu in rests["coefficient"].values:
        force = float(rests["contact_impulse"].sel(coefficient=mu).squeeze()) / 2
        known = (5 - 1 + 0.09) / (1 - 0.3 * mu)
        rows.append(relative(f"force at rest at µ = {mu:g} [N]", known, force, 1e-12, ROUNDING))
    return rows


@scene(
    "contacts",
    "Two masses that stay together for a while",
    "closed form; the masses are those of issue 4822 of ModelingToolkit.jl, under a force that changes",
    "studies/two_masses",
)
def two_masses() -> list[Row]:
    """A free mass m = 0.5 kg lands, e = 0, on a mass M = 1 kg that hangs on a spring k = 100 N/m, 10 mm away. The force
    F = 1 N + 4 N sin πt presses it on, so that both move as one, and pulls it off where F = m ẍ.
    """
    found = solved("studies/two_masses", **{"axes.scheme": "event_driven", "axes.e": 0}).squeeze()
    m, both, k, omega = 0.5, 1.5, 100.0, np.pi

    def force(t: float) -> float:
        return 1 + 4 * np.sin(omega * t)

    def apart(t: float) -> float:
        return (t**2 / 2 + 4 * (omega * t - np.sin(omega * t)) / omega**2) / m - 0.01

    lands = brentq(apart, 0.01, 0.2, xtol=1e-17)
    approach = (lands + 4 * (1 - np.cos(omega * lands)) / omega) / m
    natural, shake = np.sqrt(k / both), 4 / (k - both * omega**2)
    a = -1 / k - shake * np.sin(omega * lands)
    b = (approach * m / both - shake * omega * np.cos(omega * lands)) / natural

    def contact_force(t: float) -> float:
        own = natural**2 * (a * np.cos(natural * (t - lands)) + b * np.sin(natural * (t - lands)))
        return force(t) + m * (own + shake * omega**2 * np.sin(omega * t))

    grid = np.linspace(lands, 2, 400)
    below = int(np.argmax([contact_force(t) < 0 for t in grid]))
    leaves = brentq(contact_force, grid[below - 1], grid[below], xtol=1e-16)
    times, kinds = found["event_time"].values, found["event_kind"].values
    return [
        relative("it lands [s]", lands, times[0], 1e-12, ROUNDING),
        relative("impulse as it lands [N s]", approach * m / both, found["event_impulse"].values[0], 1e-12, ROUNDING),
        relative("it is pulled off [s]", leaves, times[kinds == 2][0], 1e-11, ROUNDING),
    ]


@scene(
    "contacts",
    "A mass on an elastic stop",
    "code_aster, test SDND101A",
    "truth/elastic_stop",
)
def elastic_stop() -> list[Row]:
    """100 kg on a spring of 1e4 N/m strike a stop of 1e6 N/m at 1 m/s: w² = 1.01e6/100, contact for π/w, largest force
    1e6/w, impulse 2e6/w².
    """
    mass = solved("truth/elastic_stop")
    return [
        Row("largest force [N]", 9950.3719, 1e6 * float(mass["max_penetration"]), 5e-5, "8 digits published"),
        Row("impulse [N s]", 198.01980, float(mass["contact_impulse"]), 5e-6, "8 digits published"),
        Row("time in contact [s]", 0.03126002, float(mass["contact_time"]), 5e-9, "7 digits published"),
    ]


@scene(
    "contacts",
    "A mass on an elastic-plastic stop (a coating)",
    "closed form, by the law of Legrand, Batailly, Pierre, J. Comput. Nonlinear Dyn. 7 (2012) 011010",
    "truth/coated_stop",
)
def coated_stop() -> list[Row]:
    """1 kg at 2 m/s strikes a stop of k = 1 N/m, whose coating crushes from F_y = 1 N on, after π/6 s. Without
    hardening the force stays F_y for √3 s, and 1.5 m are crushed. With H = 1 N/m it grows by k H/(k + H) = ½ N/m for
    √2 atan √1.5 s, and (√10 − 2)/2 m are crushed. Then the spring throws the mass back, in π/2 s.
    """
    stops, rows = solved("truth/coated_stop"), []
    crushes = {0: (np.sqrt(3), 1.5), 1: (np.sqrt(2) * np.arctan(np.sqrt(1.5)), np.sqrt(10) / 2 - 1)}
    for hardening, (lasts, worn) in crushes.items():
        stop, force = stops.sel(hardening=hardening), 1 + hardening * worn  # the largest, and the speed after it
        known = {
            "worn depth [m]": ("max_worn_depth", worn),
            "impulse [N s]": ("contact_impulse", 2 + force),
            "time in contact [s]": ("contact_time", np.pi / 6 + lasts + np.pi / 2),
            "work of crushing [J]": ("crushing_work", worn + hardening * worn**2 / 2),
        }
        for what, (name, value) in known.items():
            rows.append(relative(f"H = {hardening} N/m: {what}", value, float(stop[name]), 1e-12, ROUNDING))
    return rows


@scene(
    "contacts",
    "A rigid blade that cuts a coating",
    "statics, closed form",
    "truth/coated_oval",
)
def coated_oval() -> list[Row]:
    """A rigid blade stands in an oval casing, d(ϑ) = −4 µm + 6 µm sin(2ϑ + 0.3), which turns three times. It cuts
    max(0, (−k d − F_y)/(k + H)) in the first turn, d the least of a sector, and nothing after it: k = 1 N/µm,
    F_y = 2 N, H = 0.5 N/µm, 12 sectors. The second lobe is cut as the first.
    """
    cut = solved("truth/coated_oval").squeeze()
    angle = np.pi / 6 * (np.arange(12)[:, None] + np.linspace(0, 1, 100_001))
    least = (-4e-6 + 6e-6 * np.sin(2 * angle + 0.3)).min(axis=1)
    known = np.maximum(0, (-1e6 * least - 2) / (1e6 + 5e5))
    first, last = cut["wear_map"].values[[0, -1]]
    rows = [
        relative(f"worn depth of sector {number + 1} [m]", known[number], last[number], 1e-8, "stiffness of the blade")
        for number in np.flatnonzero(known[:6])
    ]
    return [
        *rows,
        Row("sectors that are not cut", int(np.sum(known == 0)), int(np.sum(last == 0)), 0, "a count"),
        Row("cut in the second and third turn [m]", 0, abs(last - first).max(), 1e-15, ROUNDING),
        Row("second lobe less the first [m]", 0, abs(last[6:] - last[:6]).max(), 1e-15, ROUNDING),
    ]


GROWTH = {
    0.5: -1.8363469529,
    1.0: -1.2155190929,
    1.5: -0.6037341560,
    2.5: 0.5965240980,
    3.0: 1.1865572380,
    4.0: 2.3495499778,
    6.0: 4.6201771683,
    10.0: 9.0080447499,
}
"""z² of z² cosh z = A (cosh z − 1), by A."""


@scene(
    "heat",
    "A thermo-elastic rod pressed on a wall",
    "eigenvalues of the heat equation with the contact's heat, closed form",
    "truth/pressed_rod",
)
def pressed_rod() -> list[Row]:
    """Friction heats the tip by α λ. With A = α E a L/κ it grows as exp(D z² t/L²), D = κ/(ρ c), z² cosh z = A (cosh z
    − 1): from A = 2 on, α_c = 2κ/(E a L).
    """
    rod, unit = solved("truth/pressed_rod"), 7 / (4430 * 560) / 0.04**2
    coarse, fine = (rod["growth_rate"].sel(nodes=nodes).values.ravel() / unit for nodes in (100, 200))
    limit = fine + (fine - coarse) / 3  # the error is of second order in the width of a cell
    critical = float(rod["critical_alpha"].sel(nodes=200).max())
    return [
        relative("α_c [m/s]", 2 * 7 / (1e11 * 1e-5 * 0.04), critical, 1e-12, ROUNDING),
        *growth_rates(GROWTH, limit),
    ]


@scene(
    "heat",
    "A casing that yields and is heated, too",
    "statics and momentum, closed form",
    "truth/heated_casing",
    "truth/heated_casing_impact",
)
def heated_casing() -> list[Row]:
    """Blade and casing stand in one file of matrices: w = e_blade − e_casing is the motion that closes the gap, s
    shares the heat between both sides. α_c = (1/k_b + 1/k_c)/(g_b s_b/κ_b + g_c s_c/κ_c), g the growth per kelvin; at
    rest the force is that of the cold pair over 1 − α/α_c. An impact carries (1 + e) u m_b m_c/(m_b + m_c) and warms
    each side by its share.
    """
    (k_b, k_c), (m_b, m_c), (c_b, c_c) = (1e6, 4e6), (0.02, 0.05), (0.5, 2.0)
    (g_b, g_c), (kappa_b, kappa_c), (s_b, s_c) = (4e-7, 1e-7), (0.05, 0.3), (0.7, 0.3)
    critical = (1 / k_b + 1 / k_c) / (g_b * s_b / kappa_b + g_c * s_c / kappa_c)
    cold = (50 / k_b - 20e-6) / (1 / k_b + 1 / k_c)
    rest = solved("truth/heated_casing")
    rows = [relative("α_c [W/N]", critical, float(rest["critical_alpha"].max()), 1e-12, ROUNDING)]
    for alpha in rest["alpha"].values:
        case = rest.sel(alpha=alpha).isel(t=-1)
        force = cold / (1 - alpha / critical)
        warm = alpha * force * (s_b**2 / kappa_b + s_c**2 / kappa_c)
        here, heat = (float(case[name].squeeze()) for name in ("contact_force", "temperature"))
        rows.append(relative(f"force at α = {alpha:g} W/N, settled [N]", force, here, 1e-9, ROUNDING))
        if alpha:
            rows.append(relative(f"sᵀθ at α = {alpha:g} W/N, settled [K]", warm, heat, 1e-9, ROUNDING))
    struck = solved("truth/heated_casing_impact")
    for e in struck["e"].values:
        case = struck.sel(e=e)
        impulse = (1 + e) * 2 * m_b * m_c / (m_b + m_c)
        here, heat = float(case["contact_impulse"].squeeze()), float(case["temperature"].isel(t=-1).squeeze())
        warm = 0.1 * impulse * (s_b**2 / c_b + s_c**2 / c_c)
        rows += [
            relative(f"impulse at e = {e:g} [N s]", impulse, here, 1e-9, ROUNDING),
            relative(f"sᵀθ after it at e = {e:g} [K]", warm, heat, 1e-7, "what follows in the first ns"),
        ]
    return rows
