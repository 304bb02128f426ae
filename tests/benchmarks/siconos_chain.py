"""Processor seconds per step of Siconos on a chain of 20 nodes; run by Debian's own interpreter, see ``bench_limits``.

    /usr/bin/python3 siconos_chain.py STEPS H

Prints the seconds per step and the total impulse, or nothing where Siconos is not installed.
"""

import sys
import time

import numpy as np

try:
    import siconos.kernel as sk
except Exception:  # not installed, or without what its Python module needs
    sys.exit(0)

steps, h = int(sys.argv[1]), float(sys.argv[2])
n, m, k, gap, amplitude, frequency = 20, 2.5e-3, 2.0e7, 5e-5, 100.0, 20.0
stiffness = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
stiffness[-1, -1] = k
damping = 10 * m * np.eye(n) + 2e-7 * stiffness
chain = sk.LagrangianLinearTIDS(
    np.zeros(n), np.zeros(n), m * np.eye(n), stiffness, 10 * m * np.eye(n) + 2e-7 * stiffness
)
force = np.zeros(n)
chain.setFExtPtr(force)
direction = np.zeros((1, n))
direction[0, -1] = -1.0
contact = sk.Interaction(sk.NewtonImpactNSL(0.5), sk.LagrangianLinearTIR(direction, np.array([gap])))
model = sk.NonSmoothDynamicalSystem(0.0, steps * h)
model.insertDynamicalSystem(chain)
model.link(contact, chain)
simulation = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, h), sk.MoreauJeanOSI(1.0), sk.LCP())
impulse = 0.0
begun = time.process_time()
for step in range(steps):
    chain.fExt()[-1] = amplitude * np.sin(2 * np.pi * frequency * (step + 1) * h)
    simulation.computeOneStep()
    impulse += contact.lambda_(1)[0]
    simulation.nextStep()
print((time.process_time() - begun) / steps, impulse)
