"""The example study of the design, and the shortest one."""

BLADE = """\
study: blade
title: Tip response of a compressor blade that rubs on its casing
scene:
  blade:
    nodes: 20
    length: 40 mm
    width: 30 mm
    thickness: 1 mm
    density: 4430
    specific_heat: 560
    conductivity: 7.0
    convection: 400
    expansion: 9.0e-6
    tip_stiffness: 1.0e6
    damping: {mass: 10.0, stiffness: 2.0e-7}
  casing: {gap: 20 um}
  load: {mean: 0, amplitude: 24, frequency: 5 Hz, phase: 0}
  initial: {displacement: 0, velocity: 0, temperature: 0}
  duration: 2 s
schemes:
  implicit_euler: {method: moreau, theta: 1.0}
  midpoint: {method: moreau, theta: 0.5}
axes:
  scheme: [implicit_euler, midpoint]
  e: [0, 0.5, 0.9]
  h: {log: [1e-6, 1e-4, 5]}
  alpha: [0, 30]
  scene.casing.gap: [15 um, 20 um]
zip:
  model: {mechanical_modes: [1, 3, full], thermal_modes: [4, 12, full]}
reference: {scheme: moreau, mechanical_modes: full, thermal_modes: full}
output:
  interval: 1 ms
  histories: [displacement, temperature, contact_force]
  precision: float64
"""

CHAIN = """\
study: chain
scene:
  chain: {nodes: 3, mass: 1 g, stiffness: 2e4, heat_capacity: 1}
  casing: {gap: 20 um}
  duration: 1
"""
