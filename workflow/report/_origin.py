"""Where an archive comes from: its study, when and where it was run, and by what software."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.archive import json_in, provenance
from workflow.report._html import tag

if TYPE_CHECKING:
    import xarray as xr

_FACTS = ("processor", "platform", "solver_version", "code_revision", "content_hash")


def study_of(archive: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the method of each scheme of an archive's study by its label, and the scene as resolved.

    Both are empty where provenance does not hold them.
    """
    resolved = json_in(provenance(archive), "resolved")
    schemes, scene = ({} if not isinstance(part, dict) else part for part in map(resolved.get, ("schemes", "scene")))
    methods = {
        str(k): str(form["method"]) for k, form in schemes.items() if isinstance(form, dict) and "method" in form
    }
    return methods, scene


def origin(dataset: xr.Dataset, archive: Path) -> list[str]:
    """Return the section that says where an archive comes from."""
    stored = provenance(archive)
    rows = [
        ["written", str(dataset.attrs.get("history", "")).split(": ", 1)[0]],
        ["processor time", _computing(dataset)],
    ]
    rows += [["run", _run(json_in(stored, "run"))]]
    rows += [[name.replace("_", " "), stored[name]] for name in _FACTS if name in stored]
    rows += [["versions", ", ".join(f"{name} {version}" for name, version in json_in(stored, "versions").items())]]
    facts = [tag("tr", tag("th", name, scope="row"), tag("td", text)) for name, text in rows if text]
    return [
        tag("h2", "Where this comes from"),
        tag("div", tag("table", *facts), kind="scroll"),
        tag("details", tag("summary", "The study as written"), tag("pre", stored.get("study", ""))),
    ]


def _computing(dataset: xr.Dataset) -> str:
    """Return the sum of the cases' times."""
    seconds = np.asarray(dataset["processor_time"].values, dtype=float) if "processor_time" in dataset else np.zeros(0)
    finite = seconds[np.isfinite(seconds)]
    return f"{finite.sum():.3g} s, the sum over {finite.size} cases, references aside" if finite.size else ""


def _run(run: Mapping[str, Any]) -> str:
    """Return seconds, cases and machine of the last run of an archive, as it stored them."""
    try:
        return f"{float(run['seconds']):.3g} s for {int(run['cases'])} cases on {run['where']}"
    except (ValueError, KeyError, TypeError):
        return ""
