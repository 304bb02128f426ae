"""Proof of an archive: its bytes are those that were written, and a sample of its cases comes out the same again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import archive
from workflow.cases import ChosenModes, Grid, Perturbation, arrange, case_hashes
from workflow.pinning import is_pinned
from workflow.plan import template
from workflow.run._outcome import case_of, labels_of_case
from workflow.schemes import SOLVER_VERSION, Status
from workflow.solve import Solved, exact_motion, seconds_per_case, solve
from workflow.study import StudyError
from workflow.variables import BY_NAME, COMPARED

SAMPLE = 12
"""Cases that are run again unless another number is asked for."""

_SAME = 0.01
"""Relative difference of a reduced model's errors up to which they are one: rounding changes them by far less, another
count by far more."""

_ROUNDED = 1e-8
"""Difference of errors up to which they are one too: what rounding leaves of the motion of a large structure."""

SECONDS = 60.0
"""Estimated seconds of the sample; a case that takes longer alone is not in it, unless all do."""

MOST_DIFFERENCES = 10
"""Differences that are named."""

Values = Mapping[str, NDArray[Any]]

TIMES = 30.0
"""Other libraries may change a result by so many times what a change of all data by 1e-12 does: the latter is one
direction of many, and roundings are made all along the way. Kernels of Nehalem for those of Haswell make up to 30
times of it in the studies of ``studies/hard``."""

ROUNDED = 1e-12
"""Added, as a share of a variable's largest value: changes of data may cancel where roundings do not, as in a rate of
conductance over capacity. Shares, errors and residuals take it as it is: small differences of large numbers."""

_SHARES = ("_error", "_residual", "predictability")
"""Ends of the names of what is relative itself."""

MOTION = ("displacement", "velocity", "temperature", "impulse", "contact_force", "contact_impulse")
"""Variables whose lost digits are reported: all others follow from them."""

FOLLOWED, CONVERGED = 1e-6, 1e-9
"""In the place of :data:`ROUNDED` along branches, whose steps are adapted, and for steady rubs, which Newton's method
approaches to 1e-10."""


@dataclass(frozen=True)
class Check:
    """One comparison of an archive: whether it holds, and the result in words.

    Not judged is what other versions of packages or code make otherwise than those here: it counts as holding.
    """

    name: str
    holds: bool
    detail: str
    judged: bool = True


def verify(path: Path, sample: int = SAMPLE) -> Iterator[Check]:
    """Yield the checks of an archive as they are done, the quick ones first.

    Parameters
    ----------
    path
        A finished archive.
    sample
        Number of cases to run again, spread over schemes and statuses.

    Raises
    ------
    ArchiveError
        There is no such archive, or it cannot be read.
    """
    whole = archive.is_whole(path)
    yield Check("bytes", whole, "those that were written" if whole else "some have changed since the file was written")
    if not whole:
        return  # its values may crash the process that reads them
    texts = archive.provenance(path)
    yield _content(path, texts)
    other = _other_versions(texts)
    yield Check("versions", True, "; ".join(other) or "of packages and code are those here", judged=not other)
    for check in _run_again(path, texts, sample, other_versions=bool(other)):
        yield replace(check, holds=True, judged=False) if other else check


def _run_again(path: Path, texts: dict[str, str], sample: int, *, other_versions: bool) -> Iterator[Check]:
    """Compare an archive with what its study gives here; hashes and choices with those of the same versions only."""
    try:
        grid = archive.grid_of(texts)
    except (StudyError, LookupError, ValueError, TypeError, AttributeError) as error:
        yield Check("study", False, f"cannot be read from the archive: {error}")
        return
    try:
        if not other_versions:
            yield _identity(path, grid, texts)
            if grid.decided:
                yield _choices(grid)
        rounded = [] if other_versions else _other_arithmetic(texts)
        yield from _repeat(path, grid, texts, sample, rounded)
    except Exception as error:  # what a changed byte makes of the libraries
        yield Check("values", False, f"cannot be compared: that ended with {type(error).__name__}: {error}")


def _content(path: Path, texts: dict[str, str]) -> Check:
    try:
        digest = archive.content_hash(path)
    except archive.ArchiveError as error:
        return Check("content", False, str(error))
    holds = digest == texts.get("content_hash")
    return Check("content", holds, f"hash {digest[:16]}" + ("" if holds else f" is not {texts.get('content_hash')}"))


def _identity(path: Path, grid: Grid, texts: dict[str, str]) -> Check:
    """Compare study, coordinates and the hashes of all cases with what the archive's own study gives."""
    hashes = case_hashes(grid)
    with archive.open_archive(path) as dataset:
        wrong = [
            str(name)
            for name, values in template(grid).coords.items()
            if name not in dataset.coords or not values.variable.equals(dataset[name].variable)  # NaN equals NaN
        ]
    if wrong:
        return Check("cases", False, f"other coordinates than the study gives: {', '.join(wrong)}")
    if texts.get("key") != archive.study_key(grid.study):
        return Check("cases", False, "the study in the archive is not the one it was made from")
    stored = archive.stored_hashes(path)
    others = np.any(stored != hashes, axis=1)
    if others.any():
        return Check("cases", False, f"{np.sum(others)} of {len(hashes)} are not those of the study")
    return Check("cases", True, f"all {len(hashes)} are those of the study")


def _choices(grid: Grid) -> Check:
    """Decide counts of modes anew that tolerances decided, and compare them and their errors with those stored."""
    stored, again = grid.decided, arrange(grid.study).choices
    names = {*stored, *again}
    wrong = sum(not (name in stored and name in again and _agree(stored[name], again[name])) for name in names)
    if wrong:
        return Check("choices", False, f"{wrong} of {len(names)} counts of modes are decided otherwise now")
    return Check("choices", True, f"all {len(names)} counts of modes are decided again as they were")


def _agree(stored: ChosenModes, again: ChosenModes) -> bool:
    """Tell whether two choices are one: the same counts, and the same error but for another library's rounding."""
    return stored.counts == again.counts and bool(
        np.isclose(stored.error, again.error, rtol=_SAME, atol=_ROUNDED, equal_nan=True)
    )


def _repeat(path: Path, grid: Grid, texts: dict[str, str], sample: int, other: list[str]) -> Iterator[Check]:
    """Run a sample again and compare it: bit for bit, or within rounding where the arithmetic is ``other``."""
    from threadpoolctl import threadpool_limits

    every = template(grid).data_vars.items()
    dtypes = {str(name): variable.dtype for name, variable in every if variable.dtype.kind != "S"}
    differ: list[str] = []
    blurred: list[str] = []
    numbers = _sample(path, grid, texts, sample)
    with (
        archive.open_archive(path) as dataset,
        threadpool_limits(limits=1, user_api="blas"),
        np.errstate(over="ignore", invalid="ignore"),
    ):
        failed = int(np.sum(dataset["status"].values == Status.FAILED))
        for number, k, outer, inner, solved in _solved_again(grid, numbers):
            case = case_of(dataset, number)
            if int(case["status"]) == Status.FAILED:
                continue
            stored = {name: case[name].values[np.newaxis] for name in dtypes if name in case}
            where = labels_of_case(dataset, number) or "the case"
            names = set(stored) - archive.LEFT_OUT
            again = {n: solved.values[n][k : k + 1].astype(dtype) for n, dtype in dtypes.items() if n in names}
            unlike = list(differences(stored, again))
            if unlike and other:
                allowed = sensitivity(grid, outer, inner, solved) if grid.study.branch is None else followed(again)
                unlike = list(differences(stored, again, allowed))
                lost = without_digits(again, allowed)
                blurred += [f"{where} ({', '.join(lost)})"] if lost else []
            differ += [f"{where}: {text}" for text in unlike]
            kept, message = str(case["message"].item()), archive.truncated_message(solved.messages.get(k, ""))
            if kept != message and not other:
                differ.append(f"{where}: message {kept!r} stored, {message!r} now")
    again_text = f"{len(numbers)} {'cases' if grid.points == 1 else 'lines of the sweep'} run again"
    how = f"within the effect of rounding on each (other {', '.join(other)})" if other else "bit for bit"
    if not differ:
        left = "" if not failed else f"; {failed} that failed hold nothing to compare"
        left += f"; rounding leaves no digit to compare of {'; '.join(blurred[:MOST_DIFFERENCES])}" if blurred else ""
        yield Check("sample", True, f"{again_text}, the same {how}{left}")
    for text in differ[:MOST_DIFFERENCES]:
        yield Check("sample", False, text)
    if len(differ) > MOST_DIFFERENCES:
        yield Check("sample", False, f"and {len(differ) - MOST_DIFFERENCES} more differences: {again_text}")


def _solved_again(grid: Grid, numbers: list[int]) -> Iterator[tuple[int, int, int, NDArray[np.int64], Solved]]:
    """Yield each case by its number, its position among those run with it, their outer and inner indices, and them.

    Of sweeps those are the cases of a line.
    """
    for number in numbers:
        outer, inner = divmod(number, grid.inner_count)
        line = grid.lines(np.array([inner]))
        solved = solve(grid, outer, line)
        for k, one in enumerate(line.tolist()):
            yield outer * grid.inner_count + one, k, outer, line, solved


def _other_versions(texts: dict[str, str]) -> list[str]:
    """Return the packages and the code that made an archive, where they are not those here."""
    made = {"solver": texts.get("solver_version", "none"), "code": texts.get("code_revision", "")[:12]}
    here = {"solver": str(SOLVER_VERSION), "code": archive.code_revision()[:12]}
    made, here = made | archive.json_in(texts, "versions"), here | archive.versions()
    names = [name for name in made | here if made.get(name) != here.get(name)]
    other = [f"{name} {made.get(name, 'none')}, here {here.get(name, 'none')}" for name in names]
    return other + (["some cases by others"] if {"code_revision", "versions"} & _origins(texts) else [])


def _other_arithmetic(texts: dict[str, str]) -> list[str]:
    """Return what may change the bits of an archive's results here, given the same packages and code.

    Of processors it is the architecture alone where both computed with :func:`workflow.pin`: see ``tests/portability``.
    """
    other = []
    if texts.get("processor", "").split(" ")[0] != archive.processor().split(" ")[0]:
        other.append("architecture")
    if texts.get("pinned") != "true" or not is_pinned():
        other.append("linear algebra")
    return other + (["origin of some cases"] if _origins(texts) else [])


def _origins(texts: dict[str, str]) -> set[str]:
    """Return in what some cases of an archive were run otherwise than those that came last."""
    return set(filter(None, texts.get(archive.COPIED, "").split(", ")))


def _sample(path: Path, grid: Grid, texts: dict[str, str], count: int) -> list[int]:
    """Choose cases by the content hash: one of each scheme and status first, then any, while there is time.

    Of the lines of a sweep the first points are chosen. Those that failed hold nothing to compare, and need not fail
    again: a machine was to blame, say.
    """
    random = np.random.default_rng(int(texts.get("content_hash", "0")[:16], 16))
    with archive.open_archive(path) as dataset:
        status = dataset["status"].values.ravel()
    order = random.permutation(np.flatnonzero(status != Status.FAILED))
    kinds: dict[tuple[str, int], int] = {}
    for number in order.tolist():
        kinds.setdefault((grid.settings(number // grid.inner_count).scheme.label, int(status[number])), number)
        if len(kinds) >= count:
            break
    lines = (number - number % grid.points for number in (*kinds.values(), *order.tolist()))
    chosen = list(islice(dict.fromkeys(lines), count))
    seconds = {number: grid.points * seconds_per_case(grid, number // grid.inner_count) for number in chosen}
    repeated: list[int] = []
    total = 0.0
    for number in sorted(chosen, key=seconds.__getitem__):
        total += seconds[number]
        if total <= SECONDS or not repeated:
            repeated.append(number)
    return repeated


def followed(values: Values) -> dict[str, float]:
    """Return by how much each number of a branch may differ elsewhere."""
    return {name: FOLLOWED * _size(name, values) for name, array in values.items() if array.dtype.kind == "f"}


def _size(name: str, values: Values) -> float:
    """Return what a variable's differences are measured by: its largest value, 1 where it is a share itself."""
    return 1.0 if name.endswith(_SHARES) else _largest(values[name])


def sensitivity(grid: Grid, outer: int, inner: NDArray[np.int64], solved: Solved) -> dict[str, float]:
    """Return by how much each number of a case may differ elsewhere: it is run twice more with its data changed.

    What errors are measured against, which is not run again, is taken to answer to the change as the case itself does,
    or, of a case that did not end ok, as the exact solution of its reduced model.
    """
    reach = _largest(solved.values["displacement"])
    blown_up = grid.study.reference is not None and int(solved.values["status"][0]) != Status.OK
    exact = exact_motion(grid, outer, inner) if blown_up else solved.values
    spread: dict[str, float] = {}
    moved: dict[str, float] = {}
    for direction in (1, -1):
        changed = solve(grid, outer, inner, Perturbation(direction, reach)).values
        for name, new in changed.items():
            if new.dtype.kind == "f":
                spread[name] = max(spread.get(name, 0.0), _largest_change(solved.values[name], new))
        changed_exact = Perturbation(direction, _largest(exact["displacement"]))
        again = exact_motion(grid, outer, inner, changed_exact) if blown_up else changed
        for name in COMPARED:
            moved[name] = max(moved.get(name, 0.0), _share_changed(exact[name], again[name]))
    own = float(np.nan_to_num(solved.values.get("predictability", np.zeros(1)))[0])
    allowed = {}
    for name, change in spread.items():
        reference = own if name.endswith("_error") or name == "predictability" else 0.0
        reference += moved.get(name.split("_")[0], 0.0) if name.endswith("_error") else 0.0  # else of a choice, stored
        steady = name in BY_NAME and BY_NAME[name].condition.startswith("steady")
        allowed[name] = TIMES * (change + reference) + (CONVERGED if steady else ROUNDED) * _size(name, solved.values)
    return allowed


def _largest(values: NDArray[Any]) -> float:
    """Return the largest finite size of an entry, 0 without any."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _share_changed(old: NDArray[Any], new: NDArray[Any]) -> float:
    """Return the relative L2 change of a history; 0 where it or what it is measured by is no finite number."""
    size = float(np.linalg.norm(old))
    change = float(np.linalg.norm(new - old))
    return change / size if size > 0 and np.isfinite(change) and np.isfinite(size) else 0.0


def _largest_change(old: NDArray[Any], new: NDArray[Any]) -> float:
    """Return the largest change of an entry; infinite where one of the two is no finite number."""
    same = (old == new) | (np.isnan(old) & np.isnan(new))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(old - new))
    return float(np.where(np.isnan(change), np.inf, change).max(initial=0.0))


def differences(stored: Values, again: Values, allowed: Mapping[str, float] | None = None) -> Iterator[str]:
    """Yield, for each variable that differs, its stored and its new value at the first entry that does.

    ``allowed`` is what numbers may differ by, see :func:`sensitivity`; to the bit where it is not given.
    """
    for name, new in again.items():
        old = stored[name]
        same = (old == new) | (np.isnan(old) & np.isnan(new)) if old.dtype.kind == "f" else old == new
        if allowed is not None and old.dtype.kind == "f":
            single = 2.0**-23 * np.abs(new) if old.dtype.itemsize == 4 else 0.0  # stored in single precision
            with np.errstate(invalid="ignore"):
                same |= np.abs(old - new) <= allowed[name] + single
            same |= np.isinf(allowed[name])
        if not np.all(same):
            at = int(np.argmax(~same.ravel()))
            yield f"{name} is {old.ravel()[at].item()!r} in the archive, {new.ravel()[at].item()!r} now"


def without_digits(again: Values, allowed: Mapping[str, float]) -> list[str]:
    """Return which of the stored numbers of a case rounding changes by as much as they are."""
    return [name for name in MOTION if name in again and 0 < _largest(again[name]) <= allowed[name]]
