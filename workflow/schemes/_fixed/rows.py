"""Named rows of lanes that a block of cases has besides the states of its modes."""

from __future__ import annotations

from workflow.kernels.lanes import Rows
from workflow.models import Array


class ContactRecord(Rows):
    """What a contact of the cases of a block shows: its states, and counts so far."""

    displacement: Array
    velocity: Array
    temperature: Array
    depth: Array
    """At the last step's end; the depth is that beyond the casing. Kept where a sample or a load period needs them."""
    displacement_end: Array
    velocity_end: Array
    temperature_end: Array
    depth_end: Array
    step_impulse: Array
    """At the end of a step that is sampled or ends a load period, and the impulse in it."""
    impulse: Array
    """Sum of the impulses, N s."""
    touching: Array
    impacts: Array
    contact_time: Array
    penetration: Array
    hottest: Array
    """The highest temperature is that of the load periods that have ended."""
    period_impulse: Array
    period_contact: Array
    period_hottest: Array
    period_impacts: Array
    """Impulse, contact time and impacts at the beginning of this load period, and its highest temperature so far."""


class Own(Rows):
    """Values of each case of a block, and of its last step."""

    alpha: Array
    friction: Array
    """α, W/N, and µ, 1."""
    pressed: Array
    """A flag of each pack, raised where some lane was in contact in the last step or the one before."""
    unsolved: Array
    """Time of the step in which the laws of several contacts had no solution, s; 0 for none."""


class Acting(Rows):
    """A contact in a step and what acts on it, of each case; without impulses is without those of any contact.

    Places and speeds are relative to an ``origin``, the motion of the casing about its mean place.
    """

    origin: Array
    origin_speed: Array
    origin_speed_begin: Array
    """Place of the origin at the step's end, m, and its discrete velocity there and at the beginning, m/s."""
    casing: Array
    """Place of the casing, m: in contact from there on."""
    place: Array
    speed: Array
    force: Array
    """At the step's beginning: what a law is given. The force is what it returned."""
    mobility: Array
    sinking: Array
    """See :class:`~workflow.schemes._fixed.law.Tip`."""
    worn: Array
    level: Array
    """Worn depth of the coating where the contact is, m, and the force F_y + H w at which it crushes, N; 0 and infinite
    of a casing without one."""
    speed_free: Array
    place_free: Array
    """Velocity at the step's end without impulses; of compliant contacts the place with all else that its end has, less
    the worn depth where its law is asked."""
    impulse: Array
    speed_end: Array
    force_end: Array
    """What the law returned."""
    speed_coupled: Array
    place_coupled: Array
    impulse_coupled: Array
    slope: Array
    slope_of_place: Array
    """Of several contacts: ``speed_free`` and ``place_free`` less what other contacts take by their
    ``impulse_coupled``, and the slopes of the law there."""
    temperature: Array
    thermal_velocity: Array
    """Temperature at the step's end, K, with the heat of impulses, and the thermal part of the velocity without, m/s.
    """
    drift: Array
    warmth: Array
    warming: Array
    """Known part of the contact's motion (:class:`~workflow.schemes._fixed.free_motion.InitialState`)."""
    grown: Array
    growing: Array
    expansion: Array
    """Of contacts without mass: r_i θ of the known temperatures at t = 0, its rate, and that of all temperatures at the
    step's end, m and m/s."""
    impulse_before: Array
    """In central differences: the impulse of the last step, centred on its end."""
    relative: Array
    """Velocity relative to the particular solution at the last step's end, m/s, of balances."""
    approach: Array
    """Approach velocity of the present contact, m/s."""
    approached: Array
    separated: Array
    """Sums of its square and of its product with the separation velocity, over contacts that have ended, (m/s)²."""


class Totals(Rows):
    """Sums of a march for its balances."""

    first_energy: Array
    last_energy: Array
    largest_energy: Array
    """Energy at t = 0, when it was computed last and the largest, J."""
    energy_bound: Array
    """What the energy at the last step's end does not exceed, J."""
    input_square: Array
    work_bound: Array
    """Square of the norm of the inputs by heat and friction of a unit impulse of contact, 1/kg, and a bound of the work
    they do, m/s."""
    dissipated: Array
    """Dissipated energy less the work of loads and contact, J."""
    lost: Array
    turned_over: Array
    friction_heat: Array
    """Heat lost, sum of |heat lost| over the steps, and heat of friction, J."""
    settled_loss: Array
    """Heat loss of the steady temperatures under constant heat loads, W."""
    square: Array
    """Of one contact: what damping and inputs of a unit impulse take from the motion that it causes in its step, 1/kg.
    Else Σ ω² J²/2 of the inputs of the step, J."""
