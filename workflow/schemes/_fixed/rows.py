"""Named rows of lanes that a block of cases has besides the states of its modes."""

from __future__ import annotations

from workflow.kernels.lanes import Rows
from workflow.models import Array


class Tips(Rows):
    """A contact of the cases of a block, the tip where it is one: states and counts."""

    displacement: Array
    velocity: Array
    temperature: Array
    impulse: Array
    """State at the last step end, and the sum of impulses."""
    gap: Array
    """Position of the casing, m."""
    touching: Array
    impacts: Array
    contact_time: Array
    penetration: Array
    hottest: Array
    """Counts so far; the highest temperature is that of the load periods that have ended."""
    period_impulse: Array
    period_contact: Array
    period_hottest: Array
    period_impacts: Array
    """Impulse, contact time and impacts at the beginning of this load period, and its highest temperature so far."""
    new_displacement: Array
    new_velocity: Array
    new_temperature: Array
    step_impulse: Array
    """The contact at the end of the present step and the impulse in it, for ``take_marks`` and ``observe``."""


class Own(Rows):
    """Values of each case of a block, and of its last step."""

    alpha: Array
    friction: Array
    """α, W/N, and µ, 1."""
    load: Array
    """Impulse of the load in the last step, N s."""
    pressed: Array
    """A flag of each pack, raised where some lane was in contact in the last step or the one before."""
    unsolved: Array
    """Time of the step in which the laws of several contacts had no solution, s; 0 for none."""


class Acting(Rows):
    """What acts between a contact and its casing, of each case."""

    drift: Array
    warmth: Array
    warming: Array
    """Known part of the contact's motion (:class:`~workflow.schemes._fixed.free_motion.InitialState`)."""
    impulse: Array
    """Impulse of contact in the last step, N s."""
    after: Array
    last: Array
    """Velocity and force that the contact law returned last, besides the impulse."""
    approach: Array
    """Approach velocity of the present contact, m/s."""
    approached: Array
    separated: Array
    """Sums of its square and of its product with the separation velocity, over contacts that have ended, (m/s)²."""
    place: Array
    speed: Array
    free: Array
    casing: Array
    mobility: Array
    sinking: Array
    """Arguments of a contact law: :class:`~workflow.schemes._fixed.law.Tip`."""
    loose: Array
    deep: Array
    force: Array
    alone: Array
    """Of several contacts: ``free`` and ``place`` less what the impulses of the others take, the new force of the law,
    and the impulse of the contact alone."""
    velocity: Array
    temperature: Array
    """Of several contacts: velocity and temperature at a step's end without load and contact."""
    ahead: Array
    half: Array
    """In central differences: x_n at the next step's end and the last half-step velocity."""
    before: Array
    """In central differences: impulse of a whole step centred on the last step's beginning."""
    first: Array
    """In central differences: first half-step velocity without contact."""
    thermal_velocity: Array
    """Thermal part of the velocity without contact, m/s."""
    grown: Array
    growing: Array
    expansion: Array
    """Of contacts without mass: r_i θ of the known temperatures at t = 0, its rate, and that of the others at the
    step's end without contact, m and m/s."""
    relative: Array
    """Velocity relative to the particular solution at the last step's end, m/s, of balances."""


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
    """Σ ω² J²/2 of unit inputs."""
