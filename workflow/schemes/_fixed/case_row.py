"""Rows of the cases of a block, ``(row, lane)``: what each has of its own, and what the last step left."""

from __future__ import annotations

ALPHA, DRIFT, WARMTH, WARMING = range(4)
"""α [W/N] and the known part of the tip's motion
(:class:`~workflow.schemes._fixed.start.Motion`)."""

LOAD, IMPULSE, PRESSED = range(4, 7)
"""Impulses of the load and of contact [N s] in the last step, and a flag of each pack that is raised where some lane
was in contact: elsewhere there is no impulse."""

AFTER, LAST, APPROACH, APPROACHED, SEPARATED = range(7, 12)
"""What a contact law returned last beside the impulse: velocity and force; the velocity before the present contact, and
sums over contacts that have ended of its square and of its product with the velocity after, (m/s)²."""

AHEAD, HALF, BEFORE, FIRST, DRAGGED = range(12, 17)
"""Of central differences: x_n at the next step's end, the last half-step velocity, the impulse of a whole step about
the last one's beginning, the first half-step velocity without contact and what of that heat drags along."""

PLACE, SPEED, FREE, CASING, MOBILITY = range(17, 22)
"""What a contact law is given: :class:`~workflow.schemes._fixed.contact.Tip`."""

ROWS = MOBILITY + 1
