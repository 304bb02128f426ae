"""What an axis may vary, by its dotted path: settings of a case, scene values, scheme options."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from workflow import models, schemes
from workflow.declare import Quantity, quantity_of, word_of
from workflow.study.field_types import Keyword, Reading, Text, is_whole
from workflow.study.forms import LONGEST_LIST
from workflow.study.quantities import udunits
from workflow.study.settings import (
    AUTO,
    FULL,
    CaseSettings,
    Casing,
    CasingHarmonic,
    Friction,
    Initial,
    Load,
    LoadHarmonic,
    Scene,
)

DEFAULT_SCHEME = "moreau"
MODES = ("mechanical_modes", "thermal_modes")
REDUCTION = "reduction"
TOLERANCE = "tolerance"


@dataclass(frozen=True)
class Address:
    """A value that an axis may vary: how it is read, and what it means."""

    value: Reading | Keyword | Text
    description: str

    @property
    def unit(self) -> str:
        """CF unit; empty for words."""
        return udunits(self.value.declared.unit) if isinstance(self.value, Reading) else ""


def settings(labels: tuple[str, ...], bases: tuple[str, ...]) -> dict[str, Address]:
    """Return the settings of a case that stand under ``axes`` by their bare names, for some schemes and bases."""
    addresses: dict[str, Address] = {}
    for name, value, description in _values(CaseSettings):
        if isinstance(value, Reading):
            value = dataclasses.replace(value, words=(FULL, AUTO) if name in MODES else ())
        if name == REDUCTION:
            value = Keyword(bases)
        addresses[name] = Address(value, description)
    about = "largest relative error that the reduced model of `auto` leaves; tolerance of a recommendation"
    addresses[TOLERANCE] = Address(Reading(Quantity("1", about, above=0.0)), about)
    return {"scheme": Address(Keyword(labels, labels=True), "time integration scheme")} | addresses


def setting_defaults() -> dict[str, Any]:
    """Return what the settings are where a study does not say; `tolerance` has no default."""
    defaults = {
        entry.name: entry.default for entry in dataclasses.fields(CaseSettings) if quantity_of(entry) or word_of(entry)
    }
    return {"scheme": DEFAULT_SCHEME} | defaults


def scene_values(names: tuple[str, ...], harmonics: tuple[int, int] = (0, 0)) -> dict[str, Address]:
    """Return the scene values of some models by dotted path, without the duration.

    ``harmonics`` are the numbers of harmonics of casing and load.
    """
    groups: dict[str, type] = {name: models.load(name).Parameters for name in names if models.fault(name) is None}
    groups |= {"casing": Casing, "load": Load, "initial": Initial}
    groups |= {f"casing.harmonics.{k}": CasingHarmonic for k in range(harmonics[0])}
    groups |= {f"load.harmonics.{k}": LoadHarmonic for k in range(harmonics[1])}
    groups |= {"friction": Friction}
    speed = {f"scene.{name}": Address(value, about) for name, value, about in _values(Scene) if name == "speed"}
    return speed | {
        f"scene.{group}.{name}": Address(value, description)
        for group, declared in groups.items()
        for name, value, description in _values(declared)
    }


def harmonic_counts(tree: Any) -> tuple[int, int]:
    """Return how many harmonics of casing and load a study as written has."""
    scene = tree.get("scene") if isinstance(tree, dict) else None
    groups = [scene.get(group) if isinstance(scene, dict) else None for group in ("casing", "load")]
    lists = [group.get("harmonics") if isinstance(group, dict) else None for group in groups]
    casing, load = (min(len(entries), LONGEST_LIST) if isinstance(entries, list) else 0 for entries in lists)
    return casing, load


def scheme_options(methods: Mapping[str, tuple[str, ...]]) -> dict[str, Address]:
    """Return the options of schemes by dotted path; ``methods`` holds the possible ones per label."""
    return {
        f"schemes.{label}.{name}": Address(value, f"{description} of {label}")
        for label, candidates in methods.items()
        for method in candidates
        if schemes.fault(method) is None
        for name, value, description in _values(schemes.load(method).Options)
    }


def _values(declared: type) -> Iterator[tuple[str, Reading | Keyword | Text, str]]:
    """Yield path, reading and description of the values of a declared dataclass, nested ones too."""
    hints = get_type_hints(declared)
    for entry in dataclasses.fields(declared):
        hint, quantity = hints[entry.name], quantity_of(entry)
        if quantity is not None:
            single = dataclasses.replace(quantity, per=None)
            yield entry.name, Reading(single, whole=is_whole(hint)), quantity.description
        elif (text := word_of(entry)) is not None and not text.file:
            yield entry.name, Text(text), text.description
        elif get_origin(hint) is Literal:
            yield entry.name, Keyword(get_args(hint)), entry.name.replace("_", " ")
        elif isinstance(hint, type) and dataclasses.is_dataclass(hint) and declared not in (CaseSettings, Scene):
            for name, value, description in _values(hint):
                yield f"{entry.name}.{name}", value, description
