"""A recommendation in words: a sentence that can be quoted, rows of a table, and the entries of its JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis._recommend import Choice, Recommendation, Worst
from workflow.declare import measure
from workflow.schemes import Status, limit_text
from workflow.study import AUTO, MODES
from workflow.variables import COMPARED

if TYPE_CHECKING:
    import xarray as xr

SETTINGS = ("scheme", "h", "mechanical_modes", "thermal_modes", "reduction")
"""Settings that stand in every answer; ``None`` where the archive does not have one."""

NAMED = 5
"""Undecidable cases that are named; of more the number is."""

LIMITS = {
    "step": "step",
    "basis": "basis",
    "nothing": "it is the reference",
    "unknown": "step or basis (parts not stored)",
    "status": "no result",
    "reference": "no reference",
}
"""What limits the accuracy, in words for tables."""

RECOMMENDATION_COLUMNS = (
    "tolerance",
    "choice",
    "cost per simulated second",
    "cases within",
    "largest error",
    "limited by",
)


def named_choice(choice: Choice, units: Mapping[str, str]) -> str:
    """Return scheme, step, modes and options of a choice in words, with the units of its coordinates."""
    settings = {name: value for name, value in choice.settings.items() if name not in choice.tied}
    words = [str(settings.pop("scheme", "the scheme"))]
    h = settings.pop("h", None)
    if h is not None:
        words.append(f"h = {h:.3g} s" if choice.step_matters else "any time step")
    modes = settings.pop("mechanical_modes", None), settings.pop("thermal_modes", None)
    if None not in modes:
        counts = [choice.used.get(name, count) for name, count in zip(MODES, modes, strict=True)]
        written = [AUTO if name in choice.used else count for name, count in zip(MODES, modes, strict=True)]
        by_tolerance = f" ({written[0]} + {written[1]})" if choice.used else ""
        words.append(f"{counts[0]} mechanical + {counts[1]} thermal modes{by_tolerance}")
    reduction = settings.pop("reduction", None)
    if reduction is not None:
        words.append(str(reduction))
    words += [f"{name.replace('_', ' ')} {_with_unit(name, value, units)}" for name, value in settings.items()]
    words += [f"at {name} = {_with_unit(name, value, units)}" for name, value in choice.tied.items()]
    return ", ".join(words)


def _judged(recommendation: Recommendation, choice: Choice | None) -> str:
    """Return in which cases a choice was judged: all, or those of the scene's values that a zip ties to it."""
    if choice is not None and choice.tied:
        return "all of its cases"
    scene = "" if choice is None or not choice.worst.case else f" ({' × '.join(choice.worst.case)})"
    if recommendation.choice is None or not recommendation.undecidable:
        return f"all {recommendation.cases} cases{scene}"
    decidable = recommendation.cases - len(recommendation.undecidable)
    return f"all {decidable} decidable of {recommendation.cases} cases{scene}"


def named_case(case: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Return the coordinates of a case of the scene in words, with their units."""
    return ", ".join(f"{name} = {_with_unit(name, value, units)}" for name, value in case.items()) or "the only case"


def answer_lines(recommendation: Recommendation) -> tuple[str, ...]:
    """Return the answer as short sentences: the choice, its largest error, its cost, why not the next cheaper one."""
    tolerance, units = percent(recommendation.tolerance), recommendation.units
    choice, cheaper = recommendation.choice, recommendation.next
    if choice is None:
        if cheaper is not None and cheaper.worst.status == "not_run":
            return (f"No choice that has run in all its cases meets {tolerance}.", "Run the study to its end.")
        first = f"Nothing in this study meets {tolerance} in {_judged(recommendation, cheaper)}."
        return first, *(_without(recommendation) if recommendation.missing else _nearest(recommendation))
    worst = choice.worst
    where = f"{worst.variable}, {named_case(worst.case, units)}"
    lines = [
        f"{named_choice(choice, units)} keeps within {tolerance} in {_judged(recommendation, choice)}.",
        f"Its largest error is {percent(worst.error)} ({where}), {_limit(worst)}.",
        f"It costs {_cost(choice)}.",
    ]
    if cheaper is not None:
        lines.append(
            f"The next cheaper, {named_choice(cheaper, units)} ({_cost(cheaper)}), {_failure(cheaper, units)}."
        )
    return tuple(lines)


def sentence(recommendation: Recommendation) -> str:
    """Return the answer as one text that can be quoted."""
    return " ".join(answer_lines(recommendation))


def undecidable(recommendation: Recommendation) -> str:
    """Return which cases cannot be decided, an empty text where all can."""
    cases = recommendation.undecidable
    if not cases:
        return ""
    return (
        f"These cases are undecidable at {percent(recommendation.tolerance)}, because rounding of the gap moves their "
        f"reference by more than a tenth of that: {_listed(cases, recommendation.units)}."
    )


def recommendation_cautions(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return why a recommendation may mean less than it says: cases that are not run, no contact at all."""
    reasons = []
    missing = int((dataset["status"] == Status.NOT_RUN).sum())
    if missing:
        reasons.append(f"{missing} of {dataset['status'].size} cases are not run yet")
    ok = dataset["status"] == Status.OK
    if "contact_impulse" in dataset and ok.any() and not dataset["contact_impulse"].where(ok, 0).any():
        reasons.append("no case that is ok touches its casing, so only free motion is compared")
    if missing < dataset["status"].size and _by_own_basis(dataset):
        reasons.append(
            "the reference has the modes of each case, so errors do not contain that of the reduced model; write "
            "`mechanical_modes: full, thermal_modes: full` in the reference"
        )
    return tuple(reasons)


def _by_own_basis(dataset: xr.Dataset) -> bool:
    """Tell whether counts of modes vary and no case has a model error: each is its own reference's model."""
    varies = any(name in dataset.coords and np.unique(dataset[name].values).size > 1 for name in MODES)
    parts = [dataset[f"{name}_model_error"] for name in COMPARED if f"{name}_model_error" in dataset]
    return varies and len(parts) == len(COMPARED) and not any(bool((part.fillna(0) != 0).any()) for part in parts)


def recommendation_row(recommendation: Recommendation) -> tuple[str, ...]:
    """Return a recommendation, or that of the rest, as a row of a table with :data:`RECOMMENDATION_COLUMNS`."""
    recommendation = recommendation.rest or recommendation
    shown = recommendation.choice or recommendation.next
    if shown is None:
        return percent(recommendation.tolerance), "nothing", "", "", "", ""
    name = named_choice(shown, recommendation.units)
    name = name if recommendation.choice else f"nothing; nearest is {name}"
    worst = shown.worst
    lacks_it = "no error" if worst.status == "ok" else worst.status.replace("_", " ")
    error = lacks_it if math.isnan(worst.error) else percent(worst.error)
    return percent(recommendation.tolerance), name, _cost(shown), percent(shown.share), error, LIMITS[worst.limited_by]


def recommendation_entries(recommendation: Recommendation) -> dict[str, Any]:
    """Return a recommendation as the entries of its JSON."""
    chosen = recommendation.choice
    settings = {} if chosen is None else chosen.settings
    return {
        "tolerance": recommendation.tolerance,
        **{name: settings.get(name) for name in SETTINGS},
        **({} if chosen is None else _used(chosen)),
        "options": {name: value for name, value in settings.items() if name not in SETTINGS},
        **{name: getattr(chosen, name, None) for name in ("cost", "cost_per_second", "worst", "share")},
        "limited_by": None if chosen is None else chosen.worst.limited_by,
        "next": None if recommendation.next is None else _choice(recommendation.next),
        "cases": recommendation.cases,
        "undecidable": recommendation.undecidable,
        "missing": recommendation.missing,
        "leave_out": recommendation.leave_out,
        "rest": None if recommendation.rest is None else recommendation_entries(recommendation.rest),
        "sentence": sentence(recommendation),
    }


def _choice(choice: Choice) -> dict[str, Any]:
    judged = {"cost": choice.cost, "share": choice.share, "worst": choice.worst, "limited_by": choice.worst.limited_by}
    return choice.settings | _used(choice) | judged


def _used(choice: Choice) -> dict[str, Any]:
    """Return `auto` for counts of modes that a tolerance decided, and the counts beside them."""
    return dict.fromkeys(choice.used, AUTO) | {f"{name}_used": count for name, count in choice.used.items()}


def percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100 * share:.3g} %"


def _with_unit(name: str, value: Any, units: Mapping[str, str]) -> str:
    return measure(value, units.get(name, ""), 6) if isinstance(value, float) else str(value)


def _cost(choice: Choice) -> str:
    """Return what a choice costs, per simulated second where the archive holds its duration."""
    seconds, per = (choice.cost_per_second, " per simulated second")
    if math.isnan(seconds):
        seconds, per = choice.cost, " per case"
    if math.isinf(seconds):
        return "not measured"
    scale, unit = next((pair for pair in ((1.0, "s"), (1e3, "ms")) if seconds * pair[0] >= 1), (1e6, "µs"))
    return f"{seconds * scale:.3g} {unit}{per}"


def _limit(worst: Worst) -> str:
    """Say what an error comes from."""
    return {
        "step": f"from the step ({percent(worst.scheme_error)}; basis {percent(worst.model_error)})",
        "basis": f"from the basis ({percent(worst.model_error)}; step {percent(worst.scheme_error)})",
        "nothing": "as it is the reference's own model and scheme",
        "status": f"as the case is {worst.status}",
        "unknown": "from the step or from the basis: the archive does not hold the parts",
    }[worst.limited_by]


def _without(recommendation: Recommendation) -> tuple[str, ...]:
    """Say in which cases no choice has an error and why, and the answer without them."""
    nearest, named = recommendation.next, _listed(recommendation.missing, recommendation.units)
    worst = [] if nearest is None else [nearest.worst.status.replace("ok", ""), nearest.worst.message]
    why = ": ".join(filter(None, worst))
    first = f"Nothing has an error in {len(recommendation.missing)} of them: {named}{f' ({why})' if why else ''}."
    if recommendation.rest is None:
        return first, "Every value of every axis has such a case: change what their message names, and run them again."
    return first, f"Without them, `archive.{recommendation.leave_out}`:", *answer_lines(recommendation.rest)


def _listed(cases: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> str:
    """Name some cases of the scene, and how many more there are."""
    named = "; ".join(named_case(case, units) for case in cases[:NAMED])
    return named + (f"; and {len(cases) - NAMED} more" if len(cases) > NAMED else "")


def _failure(choice: Choice, units: Mapping[str, str]) -> str:
    worst = choice.worst
    where, why = named_case(worst.case, units), f" ({worst.message})" if worst.message else ""
    if worst.status != "ok":
        return f"fails as {where} is {worst.status.replace('_', ' ')}{why}"
    if math.isnan(worst.error):
        return f"fails as {where} has no error{why}"
    return f"errs by {percent(worst.error)} ({worst.variable}, {where}), {_limit(worst)}"


def _nearest(recommendation: Recommendation) -> tuple[str, ...]:
    """Say which choice comes nearest and what to add, a sentence each."""
    choice, tolerance, units = recommendation.next, recommendation.tolerance, recommendation.units
    if choice is None:
        return ("It has no case.",)
    text = (
        f"The nearest is {named_choice(choice, units)}, which meets it in {percent(choice.share)} of the cases; it "
        f"{_failure(choice, units)}."
    )
    return text, f"Add {_remedy(choice, tolerance)}."


def _remedy(choice: Choice, tolerance: float) -> str:
    """Say what may bring a choice within the tolerance."""
    worst, h = choice.worst, choice.settings.get("h")
    if worst.limited_by == "step" and h is not None and choice.step_matters:
        return f"smaller steps: at order one about h = {limit_text(h * tolerance / worst.error, 1)} s"
    if worst.limited_by == "basis":
        return "a smaller tolerance of `auto`" if choice.used else "more modes, or `full`"
    if worst.limited_by == "status":
        return "a scheme or a step at which that case ends ok"
    if worst.limited_by == "reference":
        return "a reference that ends ok in that case"
    return "smaller steps and more modes"
