"""Rows of the cases of a block, ``(row, lane)``: what each has of its own, and what the last step left."""

from __future__ import annotations

ALPHA, DRIFT, WARMTH, WARMING = range(4)
"""α [W/N] and the known part of the tip's motion
(:class:`~workflow.schemes._fixed.start.Motion`)."""

LOAD, IMPULSE, HEAT, PRESSED = range(4, 8)
"""Impulses of the load and of contact [N s] and friction heat [J] in the last step, and a flag of each pack that is
raised where some lane was in contact: elsewhere there is neither impulse nor heat."""

CONTACT, AFTER, LAST, APPROACH, APPROACHED, SEPARATED = range(8, 14)
"""What a contact law returned last: impulse [N s], velocity and force; the velocity before the present contact, and
sums over contacts that have ended of its square and of its product with the velocity after, (m/s)²."""

AHEAD, HALF, FIRST, DRAGGED = range(14, 18)
"""Of central differences: x_n at the next step's end, the last half-step velocity, the first one without contact and
what of that heat drags along."""

PLACE, SPEED, FREE, CASING, MOBILITY = range(18, 23)
"""What a contact law is given: :class:`~workflow.schemes._fixed.contact.Tip`."""

ROWS = MOBILITY + 1
