"""What is said of a study before its cases run: numbers, an order of time, warnings, and the archive that will be."""

from workflow.plan._figures import Figures
from workflow.plan._plan import Plan, plan, plan_study
from workflow.plan._template import CHUNK_BYTES, COMPRESSED, HARMONIC, LEVEL, WARNINGS, encode, template
from workflow.plan._warnings import too_thick, warning_lines
