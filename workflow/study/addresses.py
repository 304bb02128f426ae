"""What an axis may vary, by its dotted path: settings of a case, scene values, scheme options."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import MISSING

from workflow import models, reduction, schemes
from workflow.declare import Quantity
from workflow.study.forms import Entry, RecordKind, entries_of
from workflow.study.kinds import Number, keyword, number
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
OF_SCENE = ("model", "parameters", "initial")
"""Fields of a scene that are not read as they are declared."""


def addresses(
    names: tuple[str, ...], methods: Mapping[str, tuple[str, ...]], harmonics: tuple[int, int] = (0, 0)
) -> dict[str, Entry]:
    """Return all that an axis may vary, by dotted path: settings of a case, scene values and options of schemes.

    Parameters
    ----------
    names
        Of the models.
    methods
        Those that each label of a scheme may stand for.
    harmonics
        Their numbers, of the casing and of the load.
    """
    return settings(tuple(methods)) | _scene_values(names, harmonics) | _scheme_options(methods)


def settings(labels: tuple[str, ...] = ()) -> dict[str, Entry]:
    """Return the settings of a case by their bare names, for some schemes; ``tolerance`` has no default."""
    values = dict(entries_of(CaseSettings, ("scene", "scheme")))
    for path in MODES:
        modes = Quantity("1", values[path].meaning, at_least=0)
        values[path] = dataclasses.replace(values[path], kind=number(modes, whole=True, words=(FULL, AUTO)))
    values[REDUCTION] = dataclasses.replace(values[REDUCTION], kind=keyword(reduction.names(), fault=reduction.fault))
    about = "largest relative error that the reduced model of `auto` leaves; tolerance of a recommendation"
    values[TOLERANCE] = Entry(number(Quantity("1", about, above=0.0)), about, MISSING)
    scheme = keyword(labels, labels=True, fault=_fault_of_scheme)
    return {"scheme": Entry(scheme, "time integration scheme", DEFAULT_SCHEME)} | values


def _fault_of_scheme(label: str) -> str | None:
    """Return why a method cannot be used; that of a label of the study is judged where it is defined."""
    return schemes.fault(label) if label in schemes.names() else None


def _scene_values(names: tuple[str, ...], harmonics: tuple[int, int]) -> dict[str, Entry]:
    """Return the scene values of some models by dotted path, without the duration."""
    groups: dict[str, type] = {name: models.load(name).Parameters for name in names if models.fault(name) is None}
    groups |= {"casing": Casing, "load": Load, "initial": Initial}
    groups |= {f"casing.harmonics.{k}": CasingHarmonic for k in range(harmonics[0])}
    groups |= {f"load.harmonics.{k}": LoadHarmonic for k in range(harmonics[1])}
    groups |= {"friction": Friction}
    values = {"scene.speed": entries_of(Scene, OF_SCENE)["speed"]}
    for group, declared in groups.items():
        values |= _values(entries_of(declared), f"scene.{group}")
    return values


def _scheme_options(methods: Mapping[str, tuple[str, ...]]) -> dict[str, Entry]:
    """Return the options of schemes by dotted path."""
    return {
        path: dataclasses.replace(entry, meaning=f"{entry.meaning} of {label}")
        for label, candidates in methods.items()
        for method in candidates
        if schemes.fault(method) is None
        for path, entry in _values(entries_of(schemes.load(method).Options), f"schemes.{label}")
    }


def _values(entries: Mapping[str, Entry], above: str) -> Iterator[tuple[str, Entry]]:
    """Yield the single values among some entries with their paths, those of nested mappings too."""
    for name, entry in entries.items():
        kind, path = entry.kind, f"{above}.{name}"
        if isinstance(kind, RecordKind):
            yield from _values(kind.entries, path)
        elif kind.varies:
            yield path, dataclasses.replace(entry, kind=kind.single if isinstance(kind, Number) else kind)
