"""Studies: read from YAML, checked against the declarations of models and schemes, resolved to SI."""

from __future__ import annotations

from workflow.study.addresses import MODES
from workflow.study.attached import packed, unpacked
from workflow.study.case_space import Axis, Branch, Dimension, Reference
from workflow.study.document import json_schema
from workflow.study.draws import MATRIX, POINT, Drawn
from workflow.study.edits import setting
from workflow.study.mistakes import Mistake, StudyError
from workflow.study.quantities import readable, udunits
from workflow.study.resolved import ResolvedValue, resolved_values
from workflow.study.settings import AUTO, CHOSEN, CaseSettings, Initial, Load, Output, Scene, SchemeChoice, Steady
from workflow.study.study import Study, StudySource, parse_study, read_study
