"""What an archive says: contact phases, how cases ended, who stays stable and accurate, which axes matter."""

from __future__ import annotations

from workflow.analysis._cases import (
    case_dims,
    exact,
    failures,
    finest,
    labels,
    labels_of,
    modes_along,
    naming,
    place_text,
    rounded_texts,
    runaways,
    shown_dim,
    unit_of,
    value_text,
)
from workflow.analysis._casing import casing_motion, period_frequency
from workflow.analysis._compare import compare
from workflow.analysis._decided import decided
from workflow.analysis._effects import effect, hidden
from workflow.analysis._growth import impulse_growth
from workflow.analysis._json import json_value
from workflow.analysis._limits import (
    Limits,
    NothingSteadyError,
    count_sentence,
    followed_axis,
    limit_sentence,
    limits,
)
from workflow.analysis._notable import exact_partners, exact_place, is_exact, notable_cases, shown_place, total_error
from workflow.analysis._phases import contact_phases
from workflow.analysis._precision import ERRORS, SENSELESS, Line, lines, observed_order
from workflow.analysis._recommend import (
    Choice,
    NoReferenceError,
    Recommendation,
    numerical_dims,
    recommend,
    usual_recommendations,
)
from workflow.analysis._recommend_words import (
    RECOMMENDATION_COLUMNS,
    recommendation_cautions,
    recommendation_entries,
    recommendation_row,
    sentence,
    undecidable,
)
from workflow.analysis._sobol import drawn_dim, sobol
from workflow.analysis._standing import RULE, ranges, standings
from workflow.analysis._work import work_precision
