"""Fixed-step schemes give the same bits whatever the processor offers to NumPy, BLAS and the C library."""

from __future__ import annotations

import hashlib

from processors import on_every_processor, printed_here, printed_under

RUN = """
import hashlib, numpy as np
from workflow import models, schemes
from workflow.schemes import carpenter, moreau, penalty
from workflow.models import Cases, Rayleigh

def structure(nodes):
    chain = models.load("chain")
    return chain.assemble(chain.Parameters(
        nodes=nodes, mass=2.5e-3, stiffness=2e7, damping=Rayleigh(10, 2e-7), spacing=2.5e-3, expansion=8.6e-6,
        heat_capacity=1.315, conductance=0.605, convection=0.02))

def cases(nodes, count=5):
    one, node = np.ones(count), np.ones((count, nodes))
    return Cases(
        e=np.linspace(0, 1, count), alpha=np.linspace(0, 1, count), gap=5e-5 * one, mean=5 * one, amplitude=100 * one,
        frequency=20 * one, phase=0.3 * one, steady=0.1 * node, heating=0.01 * node,
        displacement=1e-6 * np.arange(nodes) * node, velocity=1e-3 * node, temperature=0.5 * node)

runs = [
    (20, moreau, moreau.Options(), 1e-5), (60, moreau, moreau.Options(0.5), 1e-5),
    (20, carpenter, carpenter.Options(), 1e-6), (20, carpenter, carpenter.Options("lagged", "explicit"), 1e-6),
    (20, penalty, penalty.Options(), 1e-6), (20, penalty, penalty.Options(integration="implicit"), 1e-5),
    (20, moreau, moreau.Options(0.3), 1e-4), (20, carpenter, carpenter.Options(), 1e-4),  # unstable, and say so
    (1000, moreau, moreau.Options(), 1e-4),  # swept
]
digest, spoken = hashlib.sha256(), ""
for nodes, scheme, options, h in runs:
    sampling = schemes.Sampling(0.02, 1e-3, 21, True)
    results = scheme.compute(scheme.init(structure(nodes), h, options), cases(nodes), sampling)
    for values in (*results.histories.values(), *results.metrics.values()):
        digest.update(np.ascontiguousarray(values).tobytes())
    spoken += repr((results.status.tolist(), sorted(results.messages.items())))
spoken += repr(penalty.contact_limit(structure(20), penalty.Options()))
digest.update(spoken.encode())
print(digest.hexdigest())
"""


@on_every_processor
def test_bits_are_the_same_on_every_processor(settings: dict[str, str]) -> None:
    here = printed_here(RUN)
    assert len(here) == hashlib.sha256().digest_size * 2
    assert printed_under(settings, "-c", RUN) == here
