"""Files of matrices: every kind gives the same structure, and what is broken is refused within bounded memory."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse

from matrix_files import WRITERS, as_directory, as_npz, matrices_of
from scenes import heavy_chain, of_file
from workflow.declare import File
from workflow.models import Structure, UnusableMatricesError, load, write_matrices
from workflow.models._matrix_entries import in_si

CHAIN = heavy_chain(nodes=5)
ENTRIES = matrices_of(CHAIN)
E00 = np.diag([1.0, 0, 0, 0, 0])


def assembled(path: Path, **parameters: Any) -> Structure:
    return of_file(path, **{"contact": 4, **parameters})


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_every_kind_of_file_gives_the_same_structure(write: Callable[..., Path], tmp_path: Path) -> None:
    structure = assembled(write(ENTRIES, tmp_path))
    for name, matrix in ENTRIES.items():
        attribute = {"mass": "mass", "heat_capacity": "heat_capacity"}.get(name, f"{name}_matrix")
        assert np.abs(getattr(structure, attribute) - matrix).max() <= 1e-14 * np.abs(matrix).max(), name


def test_units_of_a_file() -> None:
    """t, mm and s: masses in t, stiffness in N/mm; a meter is 1000 mm, temperatures stay."""
    scales = {"mass": 1e-3, "stiffness": 1e-3, "coupling": 1.0, "heat_capacity": 1e3, "conductance": 1e3}
    back = in_si({name: matrix * scales[name] for name, matrix in ENTRIES.items()}, "mm-t-s")
    for name, matrix in ENTRIES.items():
        assert np.abs(back[name] - matrix).max() <= 1e-15 * np.abs(matrix).max()


def test_a_contact_is_a_label_an_index_or_a_vector(tmp_path: Path) -> None:
    labels = np.array(["1.x", "2.x", "3.x", "4.x", "5.x"])
    vector = np.array([0.0, 0, 0, 0, 1])
    path = as_npz({**ENTRIES, "labels": labels, "normal": vector, "contact": np.array(4)}, tmp_path)
    by_index = assembled(path).stiffness_matrix
    for contact in ("5.x", "normal", None):
        assert np.array_equal(assembled(path, contact=contact).stiffness_matrix, by_index)
    for contact, problem in (
        (5, "no index"),
        (-1, "no index"),
        ("6.x", "neither a label nor a vector"),
        ("mass", "neither"),
    ):
        with pytest.raises(UnusableMatricesError, match=problem):
            assembled(path, contact=contact)


def changed(name: str, change: Callable[[Any], Any]) -> dict[str, Any]:
    return {**ENTRIES, name: change(ENTRIES[name])}


BROKEN = {
    "not square": (changed("mass", lambda m: m[:, :4]), "must be square"),
    "another size": (changed("stiffness", lambda m: m[:4, :4]), "must have 5"),
    "not symmetric": (changed("stiffness", np.triu), "not symmetric"),
    "not finite": (changed("stiffness", lambda m: np.nan * m), "not finite"),
    "infinite": (changed("mass", lambda m: np.inf + m), "not finite"),
    "indefinite": (changed("stiffness", lambda m: -m), "not positive semi-definite"),
    "a saddle": (changed("stiffness", lambda m: np.eye(5)[[1, 0, 2, 3, 4]]), "stiffness is not positive semi-definite"),
    "pushed and not held": (changed("stiffness", lambda m: 0 * m), "coupling exerts a resultant force on"),
    "a contact without mass": (changed("mass", lambda m: m * np.diag([1, 1, 1, 1, 0])), "contact moves without mass"),
    "neither mass nor spring": (
        {**ENTRIES, "mass": np.diag([1.0, 0, 1, 1, 1]), "stiffness": np.diag([1.0, 0, 1, 1, 1])},
        "1 degrees of freedom have no inertia",
    ),
    "negative mass": (changed("mass", lambda m: -m), "mass is not positive semi-definite"),
    "wrong coupling": (changed("coupling", lambda m: m[:, :4]), "`coupling` has the shape"),
    "no stiffness": ({name: ENTRIES[name] for name in ENTRIES if name != "stiffness"}, "no `stiffness`"),
    "no conductance": ({name: ENTRIES[name] for name in ENTRIES if name != "conductance"}, "no `conductance`"),
    "complex": (changed("mass", lambda m: m + 0j), "no real numbers"),
    "shares": ({**ENTRIES, "thermal_contact": np.full(5, 0.5)}, "2.5 in sum"),
    "labels": ({**ENTRIES, "labels": np.array(["a", "b"])}, "2 labels"),
    "label twice": ({**ENTRIES, "labels": np.array(list("abcda"))}, "twice"),
    "shares that round to one": ({**ENTRIES, "thermal_contact": np.full(5, 0.2 + 1e-9)}, r"are 1\.00000000\d+ in sum"),
    "asymmetric by rounding": (
        changed("stiffness", lambda m: m * (1 + 1e-9 * np.triu(np.ones((5, 5)), 1))),
        r"-20000000\.0 at \(1, 0\), -20000000\.02\d* across: write both halves alike: \(K \+ K\.T\)/2 if",
    ),
    "free by seven digits": (
        changed("stiffness", lambda m: (m - m[0, 0] / 2 * E00) * (1 - 1e-7 * np.eye(5))),
        "stiffness is indefinite by .e-07 of its diagonal, as its numbers are rounded in the file: write them",
    ),
    "dense and sparse": (
        {**ENTRIES, **{f"mass_{part}": np.ones(1, int) for part in ("data", "row", "col", "shape")}},
        "`mass` is there twice, dense and sparse",
    ),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_what_is_no_structure_is_refused(kind: str, tmp_path: Path) -> None:
    entries, problem = BROKEN[kind]
    with pytest.raises(UnusableMatricesError, match=problem):
        assembled(as_npz(entries, tmp_path))


class Dangerous:
    """What runs when it is unpickled."""

    def __reduce__(self) -> Any:
        return os.mkdir, ("executed",)


def pickled(tmp_path: Path) -> Path:
    path = tmp_path / "blade.npz"
    np.savez(path, **{**ENTRIES, "mass": np.array([Dangerous()], dtype=object)})
    return path


def text_npz(tmp_path: Path) -> Path:
    path = tmp_path / "a.npz"
    path.write_text("1 0\n0 1\n")
    return path


def lying_npz(tmp_path: Path) -> Path:
    """A header of more than is there."""
    path = as_npz(ENTRIES, tmp_path)
    path.write_bytes(path.read_bytes().replace(b"(5, 5)", b"(9, 5)"))
    return path


def later_mat(tmp_path: Path) -> Path:
    path = tmp_path / "blade.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + bytes(600))
    return path


def head_of(name: str, text: str) -> Callable[[Path], Path]:
    """Return what writes a directory of which one file is a text."""

    def write(tmp_path: Path) -> Path:
        path = as_directory(ENTRIES, tmp_path)
        (path / "mass.mtx").unlink()
        (path / name).write_text(text)
        return path

    return write


def calculix(stiffness: str, mass: str = "1 1 1.0\n2 2 1.0\n", freedoms: str = "1.1\n1.2\n") -> Callable[[Path], Path]:
    """Return what writes CalculiX's files of two freedoms."""

    def write(tmp_path: Path) -> Path:
        path = tmp_path / "blade.sti"
        for suffix, text in ((".sti", stiffness), (".mas", mass), (".dof", freedoms)):
            path.with_suffix(suffix).write_text(text)
        return path

    return write


def output4(*names: str) -> Callable[[Path], Path]:
    """Return what writes matrices of OUTPUT4 by these names, with 1 to n on their diagonals."""

    def write(tmp_path: Path) -> Path:
        from pyyeti.nastran import op4

        path = tmp_path / "blade.op4"
        op4.write(str(path), list(names), [(k + 1.0) * np.eye(5) for k in range(len(names))])
        return path

    return write


MARKET = "%%MatrixMarket matrix coordinate "


def sized(sizes: str) -> Callable[[Path], Path]:
    """Return what writes a Matrix Market file whose head tells of so many rows, columns and entries."""
    return head_of("mass.mtx", f"{MARKET}real general\n{sizes}\n1 1 1.0\n")


BOEING = (
    f"{'a':72}b\n{4:14}{1:14}{1:14}{2:14}{0:14}\n{{}}{2:25}{2:14}{2:14}{0:14}\n{'(16I5)':16}{'(16I5)':16}{{}}\n{{}}"
)
HOSTILE: dict[str, tuple[Callable[[Path], Path], str]] = {
    "pickle": (pickled, "no NPZ file, or damaged: Object arrays cannot be loaded"),
    "text as NPZ": (text_npz, "`a.npz` is no NPZ file, or damaged: it is no ZIP archive, as numpy.savez writes"),
    "NPZ header that lies": (lying_npz, "no NPZ file, or damaged"),
    "Matrix Market header that lies": (sized("5 5 100000000000"), "no MTX file, or damaged"),
    "Matrix Market header of a giant": (sized("4000000000 4000000000 1"), "at most"),
    "MATLAB 7.3": (later_mat, "-v7"),
    "pattern": (
        head_of("mass.mtx", MARKET + "pattern general\n2 2 1\n1 1\n"),
        "mass.mtx` begins with .* pattern general`",
    ),
    "complex": (head_of("mass.mtx", MARKET + "complex general\n1 1 1\n1 1 1 0\n"), "begins with .* complex general`"),
    "cut in a number": (
        head_of("mass.mtx", MARKET + "real general\n1 1 1\n1 1 20"),
        "`mass.mtx`, line 3: `1 1 20` is not row, column and value and the end of a line",
    ),
    "index with a point": (head_of("mass.mtx", MARKET + "real general\n1 1 1\n1.0 1 1\n"), "line 3: `1.0 1 1` is"),
    "fraction of an integer": (
        head_of("mass.mtx", MARKET + "integer general\n% one\n2 2 1\n1 1 1,5\n"),
        "`mass.mtx`, line 4: `1 1 1,5` is not",
    ),
    "Harwell-Boeing pattern": (head_of("mass.rua", BOEING.format("PUA", "", "1 2 3\n1 2\n")), "of the type PUA"),
    "Harwell-Boeing with multiples": (
        head_of("mass.rua", BOEING.format("RUA", "(1P,4F20.12)", "1 2 3\n1 2\n 1.0 1.0\n")),
        r"in the format \(16I5\) \(16I5\) \(1P,4F20.12\): write",
    ),
    "Harwell-Boeing without gaps": (
        head_of("mass.rua", BOEING.format("RUA", "(4E20.12)", "    1    2    3\n12\n 1.0 1.0\n")),
        r"has 6 numbers with gaps between in the format \(16I5\)",
    ),
    "Harwell-Boeing, a row with a point": (
        head_of("mass.rua", BOEING.format("RUA", "(4E20.12)", "1 2 3\n1.5 2\n 1.0 1.0\n")),
        "has 7 numbers with gaps .*: write 3 column pointers and 2 rows, which are whole",
    ),
    "two of Nastran": (output4("KAA", "MAA", "KGG"), "`stiffness` is there twice, as KAA, MAA, KGG: keep one"),
    "one name twice": (output4("mass", "KAA", "mass"), "`mass` is there twice"),
    "CalculiX, empty": (calculix(""), "`blade.sti` has 0 rows for the 2 labels of `blade.dof`: take"),
    "CalculiX, cut off": (calculix("1 1 1.0\n"), "`blade.sti` has 1 rows for the 2 labels"),
    "CalculiX, a label cut off": (
        calculix("1 1 1.0\n2 2 1.0\n", freedoms="1.1\n1."),
        "`blade.dof`, line 2: `1.` is not node.direction",
    ),
    "CalculiX, a cyclic sector": (calculix("1 1 1.0\n4 4 1.0\n"), "has 4 rows .* a cyclic sector, which is not taken"),
    "text of another kind": (
        calculix("a line of words\n"),
        "line 1: `a line of words` is not row, column and value",
    ),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused_and_nothing_in_them_is_executed(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, problem = HOSTILE[kind]
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnusableMatricesError, match=problem):
        assembled(write(tmp_path))
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.coo_array, scipy.sparse.csc_matrix])
def test_matrices_of_python_are_written_as_they_are_read(kind: Callable[[Any], Any], tmp_path: Path) -> None:
    mass, stiffness, *rest = ENTRIES.items()
    written = write_matrices(
        tmp_path / "a.npz", **{name: kind(matrix) for name, matrix in (mass, stiffness, *rest)}, labels=list("abcde")
    )
    structure = assembled(written, contact="e", thermal_contact=4)
    assert np.abs(structure.mass - ENTRIES["mass"]).max() <= 1e-14 * ENTRIES["mass"].max()
    assert np.abs(structure.coupling_matrix - ENTRIES["coupling"]).max() <= 1e-14 * np.abs(ENTRIES["coupling"]).max()


@pytest.mark.parametrize(
    ("name", "changed", "problem"),
    [
        ("a.mat", {}, "no NPZ file"),
        ("a.npz", {"stiffness": np.triu(ENTRIES["stiffness"])}, "`stiffness` is not symmetric"),
        ("a.npz", {"coupling": ENTRIES["coupling"][:, 1:]}, "`coupling` has the shape"),
        ("a.npz", {"springs": np.eye(5)}, "no entry is called springs"),
    ],
)
def test_what_would_be_refused_is_not_written(name: str, changed: dict[str, Any], problem: str, tmp_path: Path) -> None:
    with pytest.raises(UnusableMatricesError, match=problem):
        write_matrices(tmp_path / name, **{**ENTRIES, **changed})
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("suffix", ["rua", "rsa"])
def test_harwell_boeing_is_read_by_any_format_with_gaps(suffix: str, tmp_path: Path) -> None:
    """D exponents, a scale factor, and the lower triangle of a symmetric matrix."""
    formats = {"(4D20.12)": "D", "(1P,3E24.16)": "E", "(3(1P,E24.16))": "e", "(5F16.8)": ""}
    matrix = scipy.sparse.csc_array(np.tril(ENTRIES["mass"]) if suffix == "rsa" else ENTRIES["mass"])
    for number, (form, letter) in enumerate(formats.items()):
        values = (f"{x:.16e}".replace("e", letter) if letter else f"{x:.16f}" for x in matrix.data)
        cards = (matrix.indptr + 1, matrix.indices + 1, values)
        text = "".join("".join(f" {each}\n" for each in part) for part in cards)
        path = tmp_path / str(number)
        as_directory(ENTRIES, tmp_path).rename(path)
        (path / "mass.mtx").unlink()
        head = f"{'a':72}b\n{17:14}{6:14}{5:14}{5:14}{0:14}\n{suffix.upper()}{5:25}{5:14}{matrix.nnz:14}{0:14}\n"
        (path / f"mass.{suffix}").write_text(f"{head}{'(I5)':16}{'(I5)':16}{form:20}\n{text}")
        assert np.abs(assembled(path).mass - ENTRIES["mass"]).max() <= 1e-15


@pytest.mark.parametrize("value", [np.array([]), np.zeros((0, 0)), np.array("")[None][:0]])
def test_an_empty_contact_is_one_message(value: Any, tmp_path: Path) -> None:
    for path in (as_npz({**ENTRIES, "contact": value}, tmp_path), tmp_path / "a.mat"):
        if path.suffix == ".mat":
            scipy.io.savemat(path, {**ENTRIES, "contact": value})
        with pytest.raises(UnusableMatricesError, match="`contact` is empty: write a label, an index or a vector"):
            assembled(path, contact=None)


@pytest.mark.parametrize(
    "contact", [4, 4.0, np.int16(4), "e", [0, 0, 0, 0, 1], scipy.sparse.csr_array(np.eye(5)[:, 4:])]
)
def test_contacts_are_written_as_they_are_given(contact: Any, tmp_path: Path) -> None:
    others = {"thermal_contact": contact, "tangent": "a", "labels": list("abcde")}
    structure = assembled(write_matrices(tmp_path / "a.npz", **ENTRIES, contact=contact, **others), contact=None)
    assert structure.input_contacts.tolist() == [[0, 0, 0, 0, 1]]
    assert structure.contacts.slides
    shaken = File("", "a.npz", str(tmp_path / "a.npz"), shaken=1e-9)
    model = load("matrices")
    assert model.assemble(model.Parameters(shaken)).input_contacts[0, 4] == pytest.approx(1.0, rel=1e-8)


def test_vectors_of_names_of_their_own_are_written_and_checked(tmp_path: Path) -> None:
    size = np.shape(ENTRIES["mass"])[0]
    written = write_matrices(tmp_path / "own.npz", **ENTRIES, vectors={"STRAIN": np.arange(size)})
    with np.load(written) as file:
        assert file["STRAIN"].tolist() == list(range(size))
    with pytest.raises(UnusableMatricesError, match=r"`STRAIN` has the shape \(1,\)"):
        write_matrices(tmp_path / "own.npz", **ENTRIES, vectors={"STRAIN": [1.0]})
