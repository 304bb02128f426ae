"""What a block of cases keeps from step to step beside its modes: named rows of lanes."""

from __future__ import annotations

from workflow.kernels.lanes import Rows
from workflow.models import Array


class Tips(Rows):
    """The tips of a block: their states and what has been counted."""

    displacement: Array
    velocity: Array
    temperature: Array
    impulse: Array
    """State at the last step end, and the sum of impulses."""
    gap: Array
    """Place of the casing, m."""
    touching: Array
    impacts: Array
    contact_time: Array
    penetration: Array
    hottest: Array
    """What has been counted so far; the highest temperature is that of the load periods that have ended."""
    period_impulse: Array
    period_contact: Array
    period_hottest: Array
    period_impacts: Array
    """Impulse, contact time and impacts at the beginning of the present load period, and its highest temperature."""
    new_displacement: Array
    new_velocity: Array
    new_temperature: Array
    step_impulse: Array
    """The tip at the end of the present step and the impulse in it, stored for ``take_marks`` and ``observe``."""


class Own(Rows):
    """What each case of a block has of its own, and what the last step left."""

    alpha: Array
    """α, W/N."""
    drift: Array
    warmth: Array
    warming: Array
    """The known part of the tip's motion (:class:`~workflow.schemes._fixed.start.Motion`)."""
    load: Array
    impulse: Array
    """Impulses of the load and of contact in the last step, N s."""
    pressed: Array
    """A flag of each pack that is raised where some lane was in contact: elsewhere there is no impulse."""
    after: Array
    last: Array
    """What a contact law returned last beside the impulse: velocity and force."""
    approach: Array
    """The velocity before the present contact, m/s."""
    approached: Array
    separated: Array
    """Sums over contacts that have ended of its square and of its product with the velocity after, (m/s)²."""
    place: Array
    speed: Array
    free: Array
    casing: Array
    mobility: Array
    """What a contact law is given: :class:`~workflow.schemes._fixed.contact.Tip`."""
    ahead: Array
    half: Array
    """Of central differences: x_n at the next step's end and the last half-step velocity."""
    before: Array
    """Their impulse of a whole step about the last one's beginning."""
    first: Array
    dragged: Array
    """Their first half-step velocity without contact, and what of that heat drags along."""


class Totals(Rows):
    """What a march adds up for its balances."""

    first_energy: Array
    last_energy: Array
    largest_energy: Array
    """Energy at t = 0, at the end and the largest, J."""
    dissipated: Array
    """Dissipated less work of loads and contact, J."""
    lost: Array
    turned_over: Array
    friction_heat: Array
    """Heat lost, turned over by loss, and taken in by friction, J."""
    relative: Array
    """Velocity of the tip relative to the dragged one at the last step's end, m/s."""
    settled_loss: Array
    """Heat loss of the temperatures that constant heat loads lead to, W."""
    square: Array
    """Σ ω² J²/2 of a unit of inputs."""
