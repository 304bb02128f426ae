"""Steps a batch in blocks, by any scheme with a fixed step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workflow.models import Array, Cases, project
from workflow.schemes._fixed import blocks as in_blocks
from workflow.schemes._fixed import case_row, decoupled
from workflow.schemes._fixed.drive import Drive
from workflow.schemes._fixed.march import Batch, case_rows, march_blocks
from workflow.schemes._fixed.marches import KERNELS
from workflow.schemes._fixed.modal_balance import Balances, Start, energy_of_blocks
from workflow.schemes._fixed.stepping import Ended, watch
from workflow.schemes._interface import Sampling


def step_blocks(
    operator: Any, w: Array, cases: Cases, velocity: Array, sampling: Sampling, drive: Drive | None
) -> Ended:
    """Step cases in the blocks of a scheme's operator, which carry thermal states whether they act or not.

    W is ``(case,)``; ``velocity`` are those of the modes, of central differences at -h/2, ``(case, mode)``.
    """
    structure, contact, blocks = operator.structure, operator.contact, operator.blocks
    modal, h = blocks.modal, blocks.step.tip.h
    begun = decoupled.start(modal, cases)
    begun = replace(begun, drift=np.zeros(cases.count), tip_force=np.zeros(cases.count))
    free, law = in_blocks.coefficients(blocks, contact), contact.law(cases)
    own = case_rows(cases, begun, contact.mobility(h, w))
    states, drives = in_blocks.start(blocks, cases, begun, velocity), in_blocks.drives(blocks, cases, begun)
    if not blocks.step.heat_counts:
        own[case_row.AHEAD], own[case_row.HALF] = cases.displacement[:, -1], project(modal.tip, velocity)
        states, own[case_row.FIRST] = in_blocks.first_free(blocks, states, drives, begun)
    balance = None
    if sampling.balances:
        start = Start(modal, cases, begun)
        energy = energy_of_blocks(start, *in_blocks.account(blocks, structure, cases, begun), velocity)
        balance = Balances(structure, free, start, blocks.step, energy)
    (speed, place), march = states, KERNELS[type(law)]
    batch = Batch(modal, begun, free, contact, law, march, speed.T, place.T, own, balance, drives)
    return march_blocks(batch, watch(cases, cases.mean, sampling, h, drive), sampling.duration)
