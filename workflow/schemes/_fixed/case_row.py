"""Rows of the cases of a block, ``(row, lane)``: what each has of its own, and what the last step left."""

from __future__ import annotations

ALPHA, DRIFT, WARMTH, WARMING = range(4)
"""α [W/N] and the known part of the tip's motion
(:class:`~workflow.schemes._fixed.decoupled.Motion`)."""

IMPULSE, HEAT, PRESSED = range(4, 7)
"""Impulse of load less contact [N s] and friction heat [J] of the last step, and a flag of each pack that is raised
where some lane was in contact: elsewhere there is no heat."""

CONTACT, AFTER, LAST, APPROACH, APPROACHED, SEPARATED = range(7, 13)
"""What a contact law returned last: impulse [N s], velocity and force; the velocity before the present contact, and
sums over contacts that have ended of its square and of its product with the velocity after, (m/s)²."""

AHEAD, HALF, FIRST = range(13, 16)
"""Of central differences: x_n at the next step's end, the last half-step velocity, the first one without contact."""

FRICTION, SLID = range(16, 18)
"""Of a contact that slides: µ, and µ times the impulse of contact in the last step [N s]."""

PLACE, SPEED, FREE, CASING, MOBILITY = range(18, 23)
"""What a contact law is given: :class:`~workflow.schemes._fixed.contact.Tip`."""

LOAD = 23
"""Impulse of a load that acts on blocks, in the last step, N s."""

ROWS = LOAD + 1
