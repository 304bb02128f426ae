"""The first block of a report: what the archive recommends at a tolerance, or why the archive holds no answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from workflow.analysis import (
    RECOMMENDATION_COLUMNS,
    Choice,
    NoReferenceError,
    Recommendation,
    is_exact,
    recommend,
    recommendation_cautions,
    recommendation_row,
    sentence,
    undecidable,
    usual_recommendations,
)
from workflow.report._html import note, paragraph, prose, table, tag

if TYPE_CHECKING:
    import xarray as xr


def answer(dataset: xr.Dataset, methods: Mapping[str, str]) -> tuple[list[str], Choice | None]:
    """Return the block of an archive's answer at its study's tolerance, and the choice, or what comes nearest.

    Without a reference there is no choice. ``methods`` holds the method of each scheme.
    """
    try:
        recommendation = recommend(dataset)
    except (NoReferenceError, ValueError) as error:
        explanation = (
            "Every case is the exact solution of its model (event_driven): there is no step to choose. By how much the "
            "model errs the archive does not say: its study has no `reference`."
            if is_exact(dataset, methods)
            else f"Which method, which step: {error}. Run the study with `reference: {{scheme: event_driven}}` to "
            "another archive, with -o."
        )
        return [tag("section", tag("h2", "Answer"), paragraph(prose(explanation)), kind="answer")], None
    rows = usual_recommendations(dataset, recommendation)
    body = [
        tag("h2", "Answer"),
        tag("p", prose(sentence(recommendation)), kind="quoted"),
        *(paragraph(prose(f"Beware: {caution}.")) for caution in recommendation_cautions(dataset)),
        *_undecidable(rows),
        table(RECOMMENDATION_COLUMNS, [recommendation_row(row) for row in rows]),
        note(
            "The error of a case is the largest of the relative L2 errors of its displacement, temperature and "
            "impulse; cases are all those of the scene's axes, and one that is not ok misses. Limited by step: the "
            "scheme's part of the worst error is the larger; by basis: that of the reduced model."
        ),
    ]
    return [tag("section", *body, kind="answer")], recommendation.choice or recommendation.next


def _undecidable(rows: list[Recommendation]) -> list[str]:
    """Name the cases whose reference moves too much by rounding, at the largest tolerance that has any."""
    sentences = [undecidable(row) for row in rows if row.undecidable]
    return [paragraph(text) for text in dict.fromkeys(sentences)]
