"""Settings of a study in SI: the scene, the schemes, and the settings of one case."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

from workflow import reduction
from workflow.declare import Values, quantity, word

FULL = "full"
"""Not reduced; stored as the number of interior modes, one fewer than the model has nodes."""

AUTO, CHOSEN = "auto", -1
"""As many vectors as `tolerance` asks for; stored as -1."""

History = Literal["displacement", "velocity", "temperature", "impulse", "contact_force"]
Precision = Literal["float64", "float32"]

LARGEST_PHASE = 1000.0
"""rad; the sum of ω t and a phase is then known to 1e-13 rad. Beside a phase of 1e22 rad ω t is lost in rounding."""


def _phase(of: str) -> Any:
    return quantity("rad", f"phase of {of}", default=0.0, at_least=-LARGEST_PHASE, at_most=LARGEST_PHASE)


@dataclass(frozen=True)
class LoadHarmonic:
    """One more sinusoid A sin(2π f t + φ) of the load on the tip."""

    amplitude: float = quantity("N", "amplitude of a harmonic of the load")
    phase: float = _phase("a harmonic of the load")
    frequency: float | None = quantity("Hz", "frequency of a harmonic of the load", default=None, at_least=0)
    order: float | None = quantity("1", "frequency of a harmonic of the load, over speed", default=None, at_least=0)


@dataclass(frozen=True)
class CasingHarmonic:
    """One sinusoid a sin(2π f t + φ) of the casing's motion, away from the tip where it is positive."""

    amplitude: float = quantity("m", "amplitude of a harmonic of the casing")
    phase: float = _phase("a harmonic of the casing")
    frequency: float | None = quantity("Hz", "frequency of a harmonic of the casing", default=None, at_least=0)
    order: float | None = quantity("1", "frequency of a harmonic of the casing, over speed", default=None, at_least=0)


@dataclass(frozen=True)
class Load:
    """Load f(t) = F0 + F1 sin(2π f t + φ) + harmonics on the tip [N], and a constant one on every node."""

    mean: float = quantity("N", "constant part F0 of the load on the tip", default=0.0)
    amplitude: float = quantity("N", "amplitude F1 of the load on the tip", default=0.0)
    frequency: float = quantity("Hz", "frequency of the load on the tip", default=0.0, at_least=0)
    phase: float = _phase("the load on the tip")
    steady: Values = quantity("N", "constant load per node", default=0.0, per="node")
    harmonics: tuple[LoadHarmonic, ...] = ()


@dataclass(frozen=True)
class Initial:
    """State at t = 0, a scalar for every node or one value per node."""

    displacement: Values = quantity("m", "initial displacement", default=0.0, per="node")
    velocity: Values = quantity("m/s", "initial velocity", default=0.0, per="node")
    temperature: Values = quantity("K", "initial temperature rise above the root", default=0.0, per="temperature")


@dataclass(frozen=True)
class Casing:
    """The casing that the tip rubs on, e.g. ``casing: {gap: 20 um}``."""

    gap: float = quantity("m", "tip clearance at rest, cold; any sign")
    harmonics: tuple[CasingHarmonic, ...] = ()


@dataclass(frozen=True)
class Friction:
    """What makes the heat coupling: alpha = heat_share · coefficient · sliding_speed."""

    coefficient: float = quantity("1", "friction coefficient between tip and casing", at_least=0)
    sliding_speed: float = quantity("m/s", "speed at which the tip slides along the casing", at_least=0)
    heat_share: float = quantity("1", "share of the friction heat that enters the blade", at_least=0, at_most=1)

    @property
    def alpha(self) -> float:
        """Heat coupling α, W/N."""
        return self.heat_share * self.coefficient * self.sliding_speed


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Model, casing, load, initial state and duration of a case.

    ``model`` is the name of a module of ``workflow/models/`` and ``parameters`` an instance of its ``Parameters``. An
    ``initial`` state ``"static"`` is equilibrium under the constant loads. ``speed`` is 0 where none is given, and
    ``friction`` is ``None`` where α is given as it is.
    """

    model: str
    parameters: Any
    casing: Casing
    load: Load = field(default_factory=Load)
    initial: Initial | Literal["static"] = field(default_factory=Initial)
    duration: float = quantity("s", "duration of every case", above=0)
    speed: float = quantity("Hz", "revolutions per second, of which an `order` is a multiple", default=0.0, at_least=0)
    friction: Friction | None = None

    @property
    def gap(self) -> float:
        """Tip clearance at rest, cold, m."""
        return self.casing.gap


@dataclass(frozen=True)
class SchemeChoice:
    """A method of time integration with its options, under the label the study gives it."""

    label: str
    method: str
    options: Any


@dataclass(frozen=True)
class CaseSettings:
    """The settings of one case, everything resolved; e, alpha, h in SI, modes as counts."""

    scene: Scene
    scheme: SchemeChoice
    e: float = quantity("1", "restitution coefficient", default=0.0, at_least=0, at_most=1)
    alpha: float = quantity("W/N", "friction heat into the blade per contact force and second", default=0.0, at_least=0)
    h: float = quantity("s", "time step", default=1e-4, above=0)
    reduction: str = word("basis of the reduced model", default=reduction.DEFAULT)
    mechanical_modes: int = quantity("1", "mechanical vectors kept beside the tip's own", default=FULL, at_least=0)
    thermal_modes: int = quantity("1", "thermal vectors kept beside the tip's own", default=FULL, at_least=0)


@dataclass(frozen=True)
class Steady:
    """Search for the steady rub that each case of event_driven leads to."""

    periods: int = quantity(
        "1", "most common periods of the loads in a period of the rub", default=4, at_least=1, at_most=64
    )
    samples: int = quantity("1", "samples of its orbit", default=100, at_least=1, at_most=10_000)


_BALANCES = "whether to keep energy_residual and heat_residual; a step takes about half as long again with them"
_DEPTH = "depth from the tip over which a mean temperature is kept; each case runs twice for it"
_SECTIONS = "whether to keep the tip's state at the start of each load period, its impacts and extreme displacements"


@dataclass(frozen=True)
class Output:
    """What the archive keeps of every case; ``steady`` is ``None`` where steady rubs are not looked for."""

    interval: float = quantity("s", "sampling of all histories; default: duration/1000", above=0)
    histories: tuple[History, ...] = ("displacement", "temperature", "contact_force")
    precision: Precision = "float64"
    balances: bool = field(default=True, metadata={"meaning": _BALANCES})
    sections: bool = field(default=False, metadata={"meaning": _SECTIONS})
    steady: Steady | None = None
    temperature_depth: float | None = quantity("m", _DEPTH, default=None, above=0)

    @property
    def sampled(self) -> tuple[str, ...]:
        """Names of all histories that the archive keeps."""
        depth = ("depth_temperature",) if self.histories and self.temperature_depth is not None else ()
        return (*self.histories, *depth)

    @property
    def of_branches(self) -> Output:
        """What an archive of branches keeps: no histories, balances, sections and depths, always steady rubs."""
        steady = self.steady or Steady()
        return replace(self, histories=(), balances=False, sections=False, steady=steady, temperature_depth=None)
