"""Studies: read from YAML, checked against the declarations of models and schemes, resolved to SI.

``study`` reads one: ``source`` keeps the line of every entry, ``forms``, ``ranges`` and ``document`` say what may be
written, ``axes`` makes dimensions and ``checks`` compares fields. Others use what is imported here, first of all
:func:`read_study` and the :class:`Study` that it returns.
"""

from __future__ import annotations

from workflow.study.document import MODES, json_schema
from workflow.study.files import packed, unpacked
from workflow.study.mistakes import Mistake, StudyError
from workflow.study.quantities import readable, udunits
from workflow.study.ranges import MATRIX, POINT, SWEEP, Drawn
from workflow.study.settings import (
    AUTO,
    CHOSEN,
    Axis,
    Branch,
    CaseSettings,
    Change,
    Dimension,
    Initial,
    Load,
    Output,
    Reference,
    Scene,
    SchemeChoice,
    Steady,
    gaps_of,
)
from workflow.study.source import GAP, GAP_OF, setting
from workflow.study.study import ResolvedValue, Study, StudySource, parse_study, read_study, resolved_values
