"""Cost per case over the number of cases, of nodes and of modes: ``python tests/benchmarks/bench_scaling.py``.

Cases: whole runs of the trivial study, from the text to the archive on the disk. Nodes: a step of the full heavy
chain by ``moreau``, in modes. Modes: a step of a long chain reduced to more and more modes. Where cost should
be proportional the slope of its logarithm is fitted: 1 is a straight line through 0. What a step costs beside its modes
makes it smaller on a straight line too: how far cost lies from the best one, with any value at 0, is said as well.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))

import bench_limits
import bench_workflow
import numpy as np

from scenes import heavy_chain
from workflow import run_study
from workflow.reduction import reduce_structure

FIGURE = Path(__file__).with_name("scaling.png")


@dataclass(frozen=True)
class Extent:
    """What is measured: cases of a run; nodes of full chains; modes of a reduced one; cases and steps of a batch."""

    cases: tuple[int, ...] = (1, 10, 1_000, 100_000, 1_000_000)
    nodes: tuple[int, ...] = (5, 10, 20, 40, 80, 160, 320)
    modes: tuple[int, ...] = (2, 5, 10, 20, 40, 80)
    batch: int = 64
    steps: int = 4_000_000
    """Steps times nodes of a run."""
    runs: int = 3


TINY = Extent(cases=(1, 10), nodes=(5, 10), modes=(2, 5), batch=8, steps=400, runs=1)


@dataclass(frozen=True)
class Curve:
    """Seconds over a number, and from which number on they should be proportional to it."""

    title: str
    unit: str
    numbers: np.ndarray
    seconds: np.ndarray
    straight_from: int

    @property
    def slope(self) -> float:
        """Slope of log seconds over log number where cost should be proportional."""
        far = self.numbers >= self.straight_from
        return float(np.polyfit(np.log(self.numbers[far]), np.log(self.seconds[far]), 1)[0])

    @property
    def bend(self) -> float:
        """Largest distance of seconds from the straight line that fits them best, in shares of them; at all numbers."""
        line = np.stack([1.0 / self.seconds, self.numbers / self.seconds], axis=1)
        fitted, *_ = np.linalg.lstsq(line, np.ones(self.numbers.size), rcond=None)
        return float(np.max(np.abs(line @ fitted - 1.0)))


def _run(cases: int, runs: int) -> float:
    """Return the wall time of a whole run, s."""
    text = bench_workflow.trivial(max(2, cases), bench_workflow.METRICS)
    study, taken = bench_workflow.parsed(text.replace("{lin: [0, 0.9, 1]}", "[0.5]")), []
    if cases == 1:
        study = study.with_({"axes.alpha": [0.5]})
    for _ in range(runs if cases < 10_000 else 1):
        with bench_workflow.scratch() as directory:
            begun = time.perf_counter()
            run_study(study, directory / "a.nc")
            taken.append(time.perf_counter() - begun)
    return median(taken)


def over_cases(extent: Extent) -> Curve:
    """Return seconds of whole runs."""
    _run(10, 1)  # compiled, loaded
    seconds = [_run(cases, extent.runs) for cases in extent.cases]
    numbers = np.array(extent.cases)
    return Curve("a whole run, per case", "cases", numbers, np.array(seconds), int(numbers[-2]))


def _second_half(numbers: tuple[int, ...]) -> int:
    """Return from which number on cost should be proportional: what a step costs beside is small there."""
    return numbers[(len(numbers) - 1) // 2]


def _steps(extent: Extent, size: int) -> int:
    return max(2, extent.steps // size)


def over_nodes(extent: Extent, title: str, sizes: tuple[int, ...]) -> Curve:
    """Return processor seconds of a step of a case of full chains."""
    seconds = []
    for nodes in sizes:
        chain, steps = heavy_chain(nodes=nodes), _steps(extent, nodes)
        batch = bench_limits.rub(chain, extent.batch)

        def work(steps: int, chain: object = chain, batch: object = batch) -> object:
            return bench_limits.run(chain, batch, 1e-6, steps)  # type: ignore[arg-type]

        seconds.append(_per_step(extent, steps, work))
    return Curve(title, "nodes", np.array(sizes), np.array(seconds), _second_half(sizes))


def over_modes(extent: Extent) -> Curve:
    """Return processor seconds of a step of a case of a reduced chain; as many thermal as mechanical modes."""
    full, seconds = heavy_chain(nodes=2 * extent.modes[-1]), []
    for modes in extent.modes:
        reduction, steps = reduce_structure(full, modes, modes), _steps(extent, modes)
        batch = reduction.project(bench_limits.rub(full, extent.batch))

        def work(steps: int, structure: object = reduction.structure, batch: object = batch) -> object:
            return bench_limits.run(structure, batch, 1e-6, steps)  # type: ignore[arg-type]

        seconds.append(_per_step(extent, steps, work))
    return Curve("reduced, a step", "modes", np.array(extent.modes), np.array(seconds), _second_half(extent.modes))


def _per_step(extent: Extent, steps: int, work: object) -> float:
    """Return the seconds of a step of a case, set-up left out: a long run less a short one."""
    short, long = bench_limits.least(extent.runs, lambda: work(steps), lambda: work(3 * steps))  # type: ignore[operator]
    return max(long - short, 1e-12) / (2 * steps * extent.batch)


def curves(extent: Extent) -> list[Curve]:
    """Return all curves."""
    full = over_nodes(extent, "full in modes, a step", extent.nodes)
    return [over_cases(extent), full, over_modes(extent)]


def lines(measured_curves: list[Curve]) -> list[bench_limits.Line]:
    """Return a line for each number of cases and for each slope."""
    runs, *others = measured_curves
    rows: list[bench_limits.Line] = [
        (f"whole run of cheap cases, {number} cases, per case", "", f"{1e6 * seconds / number:.3g} us", "")
        for number, seconds in zip(runs.numbers, runs.seconds, strict=True)
    ]
    for curve in measured_curves:
        what = f"{curve.title}: slope over {curve.unit}, from {curve.straight_from} to {curve.numbers[-1]}"
        rows.append((what, "1", "", f"{curve.slope:.2f}"))
    for curve in others:
        ends = f"from {curve.numbers[0]} to {curve.numbers[-1]}"
        rows.append((f"{curve.title}: off a straight line over {curve.unit}, {ends}", "", "", f"{curve.bend:.2f}"))
    for curve in others:
        what = f"{curve.title}, {curve.numbers[-1]} {curve.unit}, for each"
        rows.append((what, "", f"{1e9 * curve.seconds[-1] / curve.numbers[-1]:.3g} ns", ""))
    return rows


def draw(measured_curves: list[Curve], to: Path = FIGURE) -> None:
    """Draw cost over cases, nodes and modes, with the straight line through the last point."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(8.5, 2.8), layout="constrained")
    for axes, curve in zip(figure.subplots(1, 3), measured_curves, strict=True):
        per_case = curve.unit == "cases"
        scale = 1e6 if per_case else 1e9
        values = scale * curve.seconds / (curve.numbers if per_case else 1)
        last, numbers = values[-1], curve.numbers
        straight = np.full(numbers.size, last) if per_case else last * numbers / numbers[-1]
        axes.loglog(numbers, straight, color="0.6", linestyle="--", linewidth=1, label="proportional")
        axes.loglog(numbers, values, "o-", color="C0", markersize=4, label=f"measured, slope {curve.slope:.2f}")
        axes.set(xlabel=f"number of {curve.unit}", ylabel="µs" if per_case else "ns", title=curve.title)
        axes.title.set_fontsize(10)
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, frameon=False)
    figure.savefig(to, dpi=100)


def main(extent: Extent | None = None, to: Path | None = None) -> None:
    """Print the lines, and draw them where ``to`` says."""
    measured_curves = curves(extent or Extent())
    for what, target, measured, ratio in lines(measured_curves):
        print(f"{what:70} {target:4} {measured:12} {ratio}")
    if to is not None:
        draw(measured_curves, to)


if __name__ == "__main__":
    main(to=FIGURE if "--write" in sys.argv else None)
