"""What an archive says: contact phases, how cases ended, who stays stable and accurate, which axes matter."""

from __future__ import annotations

from workflow.analysis._cases import (
    RPM,
    case_dims,
    contact_text,
    exact,
    failures,
    finest,
    is_of_contacts,
    is_speed,
    labels,
    labels_of,
    modes_along,
    most_loaded,
    naming,
    place_text,
    require_numbers,
    rounded_texts,
    runaways,
    shown_dim,
    swept_axis,
    unit_of,
    value_text,
)
from workflow.analysis._compare import compare
from workflow.analysis._effects import drawn_dim, effect, hidden, sobol
from workflow.analysis._limits import (
    Limits,
    NothingSteadyError,
    boundary_axes,
    followed_axis,
    limit_lines,
    limit_sentence,
    limits,
)
from workflow.analysis._notable import exact_partners, exact_place, is_exact, notable_cases, shown_place, total_error
from workflow.analysis._recommend import (
    Choice,
    NoReferenceError,
    Recommendation,
    decided,
    numerical_dims,
    recommend,
    usual_recommendations,
    work_precision,
)
from workflow.analysis._recommend_words import (
    LIMITS,
    RECOMMENDATION_COLUMNS,
    answer_lines,
    recommendation_cautions,
    recommendation_entries,
    recommendation_row,
    sentence,
    undecidable,
)
from workflow.analysis._scene import casing_motion, contact_phases, gap_of, impulse_growth, period_frequency, spectrum
from workflow.analysis._standing import ERRORS, RULE, SENSELESS, Line, lines, observed_order, ranges, standings
