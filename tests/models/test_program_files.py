"""Files as Abaqus and Nastran write them, in each of their forms: the matrices that they stand for, or a refusal."""

from pathlib import Path

import numpy as np
import pytest

from scenes import of_file
from workflow.models import UnusableMatricesError
from workflow.models._matrix_files import files_of, read_entries
from workflow.models._structure import Rayleigh

STIFFNESS = """** a beam of Abaqus with internal freedoms, held at node 1 and reduced to a few of its lines
-1,1, -1,1,  3.333333333333317e+01
2,1, -1,1, -2.500000000000002e+01
1,1, 1,1,  1.000000000000000e+36
2,1, 1,1, -3.000000000000020e+02
2,1, 2,1,  3.000000000000020e+02
2,2, 2,2,  1.199999999999999e+01
2,6, 2,2, -5.999999999999996e+00
2,6, 2,6,  4.000000000000004e+00
"""
MASS = "-1,1, -1,1, 0.5\n1,1, 1,1, 1.0\n2,1, 2,1, 2.0\n2,2, 2,2, 2.0\n2,6, 2,6, 0.25\n"
K = np.array(
    [
        [33.33333333333317, 0, -25.00000000000002, 0, 0],
        [0, 1e36, -300.000000000002, 0, 0],
        [-25.00000000000002, -300.000000000002, 300.000000000002, 0, 0],
        [0, 0, 0, 11.99999999999999, -5.999999999999996],
        [0, 0, 0, -5.999999999999996, 4.000000000000004],
    ]
)
LABELS = ["-1.1", "1.1", "2.1", "2.2", "2.6"]


def abaqus(directory: Path, **parts: str) -> Path:
    """Write the files of a job's third step, named by the kinds that Abaqus gives them."""
    for kind, text in {"STIF": STIFFNESS, "MASS": MASS, **parts}.items():
        if text:
            (directory / f"blade-a_{kind}3.mtx").write_text(text)
    return directory / "blade-a_STIF3.mtx"


def test_matrix_input_of_abaqus_names_its_freedoms_and_holds_what_is_held(tmp_path: Path) -> None:
    damping = "2,2, 2,2, 0.1\n2,6, 2,2, 0.02\n2,6, 2,6, 0.03\n"
    load = "** Assembled nodal loads\n*CLOAD, REAL\n2,2,  5.4e+04\n2,6, -1.e3\n"
    path = abaqus(tmp_path, DMPV=damping, LOAD=load)
    assert [part.name[8:] for part in files_of(path)] == ["STIF3.mtx", "MASS3.mtx", "DMPV3.mtx", "LOAD3.mtx"]
    entries = read_entries(path)
    assert entries["labels"].tolist() == LABELS
    assert np.array_equal(entries["stiffness"].toarray(), K)
    assert np.array_equal(entries["mass"].diagonal(), [0.5, 1.0, 2.0, 2.0, 0.25])
    assert np.array_equal(entries["damping"].toarray()[3:, 3:], [[0.1, 0.02], [0.02, 0.03]])
    assert np.array_equal(entries["load"], [0, 0, 0, 5.4e4, -1e3])
    structure = of_file(path, contact="2.2")
    free = np.delete(np.delete(K, 1, 0), 1, 1)
    assert structure.mechanical_size == 4
    assert structure.coordinates.held == (1, 0)
    inertia = np.diag([0.5, 2.0, 2.0, 0.25])
    flexibility = np.linalg.inv(structure.stiffness_matrix)[-1, -1]
    assert flexibility == pytest.approx(np.linalg.inv(free)[2, 2], rel=1e-12)
    assert np.sort(np.linalg.eigvals(np.linalg.solve(structure.mass, structure.stiffness_matrix)).real) == (
        pytest.approx(np.sort(np.linalg.eigvals(np.linalg.solve(inertia, free)).real), rel=1e-10)
    )


def test_a_job_may_be_called_as_one_of_its_files(tmp_path: Path) -> None:
    for kind, text in (("STIF", STIFFNESS), ("MASS", MASS)):
        (tmp_path / f"LOAD_MASS1_{kind}1.mtx").write_text(text)
    assert np.array_equal(read_entries(tmp_path / "LOAD_MASS1_STIF1.mtx")["stiffness"].toarray(), K)


BY_BLANKS = str.maketrans(",", " ")


@pytest.mark.parametrize("half", ["lower", "upper", "both"])
def test_labels_of_abaqus_with_either_triangle_or_both(half: str, tmp_path: Path) -> None:
    """A program may write ``2.2 2.6`` or ``2.6 2.2``, and not all by the same rule."""
    lines = [line.split(",") for line in STIFFNESS.splitlines()[1:]]
    across = [[c, d, a, b, value] for a, b, c, d, value in lines if (a.strip(), b) != (c.strip(), d)]
    chosen = {
        "lower": lines,
        "upper": [*across, *(line for line in lines if line[:2] == [x.strip() for x in line[2:4]])],
    }
    chosen["both"] = lines + across
    text = "".join("  ".join(line) + "\n" for line in chosen[half])
    entries = read_entries(abaqus(tmp_path, STIF=text, MASS=MASS.translate(BY_BLANKS)))
    assert entries["labels"].tolist() == LABELS
    assert np.array_equal(entries["stiffness"].toarray(), K)


@pytest.mark.parametrize("load", ["", "2  -3.5\n", "2 1 -3.5\n"])
def test_coordinates_of_abaqus_have_no_labels(load: str, tmp_path: Path) -> None:
    stiffness, mass = "1 1 4.0e+00\n2 1 -1.0e+00\n2 2 3.0\n3 3 1e36\n", "1 1 1.0\n2 2 1.0\n3 3 1.0\n"
    entries = read_entries(abaqus(tmp_path, STIF=stiffness, MASS=mass, LOAD=load))
    assert "labels" not in entries
    assert np.array_equal(entries["stiffness"].toarray(), [[4, -1, 0], [-1, 3, 0], [0, 0, 1e36]])
    assert not load or np.array_equal(entries["load"], [0, -3.5, 0])


def card(*fields: object) -> str:
    """Return a line of small fields."""
    return "".join(f"{field:<8}" for field in fields).rstrip() + "\n"


SMALL = (
    "$ a comment\n"
    + card("GRID", 1, "", "0.", "0.", "0.")
    + card("DMIG", "KAAX", 0, 6, 1, 0)
    + card("DMIG", "KAAX", 1, 1, "", 1, 1, "4.+3")
    + card("DMIG", "KAAX", 1, 2, "", 1, 1, "-1.0+3", "", "+A1")
    + card("+A1", 1, 2, "3.0D+3")
    + card("DMIG", "KAAX", 10, "", "", 10, "", "2.5+2")
    + card("DMIG", "MAAX", 0, 1, 2, 0)
    + card("DMIG", "MAAX", 1, 1, "", 1, 1, "2.")
    + card("", 1, 2, "0.5")
    + card("DMIG", "MAAX", 1, 2, "", 1, 1, ".5")
    + card("", 1, 2, "3.", "", 10, "", "0.0")
    + card("DMIG", "MAAX", 10, 0, "", 10, 0, 1)
    + "ENDDATA\n"
)
LARGE = """DMIG    KAAX           0       6       2       0                       3
DMIG*   KAAX                           1               1
*                      1               1 4.000000000D+03
DMIG*   KAAX                           1               2
*                      1               1-1.000000000D+03
*                      1               2 3.000000000D+03
DMIG*   KAAX                          10               0
*                     10               0 2.500000000D+02
DMIG    MAAX           0       6       2       0                       3
DMIG*   MAAX                           1               1
*                      1               1 2.000000000D+00
*                      1               2 5.000000000D-01
DMIG*   MAAX                           1               2
*                      1               2 3.000000000D+00
DMIG*   MAAX                          10               0
*                     10               0 1.000000000D+00
DMIG    BAAX           0       6       2       0                       3
DMIG    MUG1           0       9       2       0                       3
DMIG*   MUG1                           1               0
*                      1               1 7.000000000D+00
"""
FREE = """DMIG,KGG,0,6,2
DMIG,KGG,1,1,,1,1,4.0E+3
DMIG,kgg,1,2,,1,1,-1.E3,,+
+,1,2,3000.
DMIG*,KGG,10,0
*,10,0,250.
DMIG,MGG,0,6,2
DMIG,MGG,1,1,,1,1,2.,,
,1,2,.5
DMIG,MGG,1,2,,1,2,3.
DMIG, MGG , 10, 0, , 10, , 1.
"""


@pytest.mark.parametrize("text", [SMALL, LARGE, FREE], ids=["small", "large", "free"])
def test_punched_matrices_of_nastran(text: str, tmp_path: Path) -> None:
    """Source: MSC Nastran Quick Reference Guide, DMIG; large fields as SOL 103 punches them with EXTSEOUT."""
    (tmp_path / "blade.pch").write_text(text)
    entries = read_entries(tmp_path / "blade.pch")
    assert entries["labels"].tolist() == ["1.1", "1.2", "10.0"]
    assert np.array_equal(entries["stiffness"].toarray(), [[4000, -1000, 0], [-1000, 3000, 0], [0, 0, 250]])
    assert np.array_equal(entries["mass"].toarray(), [[2, 0.5, 0], [0.5, 3, 0], [0, 0, 1]])
    assert set(entries) == {"labels", "stiffness", "mass"}


REFUSED = {
    "no mass beside it": ({"MASS": ""}, r"blade-a_MASS3.mtx is not beside it"),
    "a number with a comma": ({"MASS": "2,1, 2,1, 1,5\n"}, r"MASS3.mtx`, line 1: `2 1  2 1  1 5` is not node, dof"),
    "a number cut off": ({"STIF": STIFFNESS[:-6]}, r"STIF3.mtx`, line 9: .* and the end of a line"),
    "element by element": (
        {"STIF": "1,1,1, 1,1, 4.0\n"},
        r"STIF3.mtx`, line 1: `1 1 1  1 1  4.0` is not node, dof, node",
    ),
    "two forms": ({"MASS": "1 1 1.0\n"}, "the files of `blade-a_STIF3.mtx` have several forms"),
    "an entry twice": ({"MASS": MASS + "2,6, 2,6, 0.25\n"}, "mass` has an entry twice"),
    "rows without entries": (
        {"STIF": "1 1 1.0\n3 3 1.0\n", "MASS": "1 1 1.0\n"},
        "blade-a_STIF3.mtx` has rows without an entry: write labels",
    ),
    "loads of several cases": (
        {"STIF": "1 1 1.0\n", "MASS": "1 1 1.0\n", "LOAD": "1 1 1.0\n1 2 1.0\n"},
        "`blade-a_STIF3.mtx` has several loads beside it",
    ),
    "two loads": ({"LOAD": "*CLOAD, REAL\n2,2, 1.0\n*CLOAD, IMAGINARY\n2,2, 1.0\n"}, "LOAD3.mtx` has several loads"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_abaqus_did_not_write_so_is_refused(kind: str, tmp_path: Path) -> None:
    parts, problem = REFUSED[kind]
    path = abaqus(tmp_path, **parts)
    with pytest.raises((UnusableMatricesError, ValueError), match=problem):
        [read_entries(path) for _ in files_of(path)]


REFUSED_CARDS = {
    "a complex matrix": (
        card("DMIG", "KAAX", 0, 6, 3) + card("DMIG", "KAAX", 1, 1, "", 1, 1, "1.", "2."),
        "KAAX is of the form 6 and the type 3",
    ),
    "a rectangular matrix": (
        card("DMIG", "KAAX", 0, 9, 2) + card("DMIG", "KAAX", 1, "", "", 1, 1, "1."),
        "KAAX is of the form 9 and the type 2",
    ),
    "other names": (card("DMIG", "KXSE10", 0, 6, 2), "has the DMIG matrices KXSE10: name them KAAX, MAAX"),
    "no number": (card("DMIG", "KAAX", 0, 6, 2), "has the DMIG matrices KAAX"),
    "no matrix": (card("GRID", 1), "has the DMIG matrices none"),
    "two of a kind": (LARGE + FREE, "`stiffness` is there twice"),
    "a number longer than its field": (
        card("DMIG", "KAAX", 0, 6, 2) + "$\n" + card("DMIG", "KAAX", 1, 1, "", 1, 1, "1.2345678", "9"),
        "`blade.pch`, line 3: `1 1 1 1 1.234567 89` is not nodes, components and a real number",
    ),
    "a number cut off": (LARGE[: LARGE.index("D+00\nDMIG    BAAX")], "line 16: `.* 1.000000000` is not an entry and"),
    "small, without the last end": (SMALL[: -len("\nENDDATA\n")], "line 13: `DMIG  .* 1` is not an entry and the end"),
    "free, cut in a column's head": (FREE[: -len(", , 10, , 1.\n")], "line 11: `DMIG, MGG , 10, 0` is not an entry"),
    "cut within": (LARGE.replace("3.000000000D+03", "3.000000000D"), "line 6: `1 2 1 2 3.000000000D` is not nodes"),
}


@pytest.mark.parametrize("kind", REFUSED_CARDS)
def test_what_is_no_real_square_matrix_by_a_known_name_is_refused(kind: str, tmp_path: Path) -> None:
    text, problem = REFUSED_CARDS[kind]
    (tmp_path / "blade.pch").write_text(text)
    with pytest.raises(UnusableMatricesError, match=problem):
        read_entries(tmp_path / "blade.pch")


def test_structural_damping_is_not_left_out_in_silence(tmp_path: Path) -> None:
    """An imaginary stiffness has no motion in time: the study says which damping stands for it."""
    path = tmp_path / "blade.pch"
    k4 = LARGE[: LARGE.index("DMIG    MAAX")].replace("KAAX ", "K4AAX")
    path.write_text(LARGE + k4)
    with pytest.raises(UnusableMatricesError, match=r"structural damping .*: state `damping: {ratio: …}`"):
        of_file(path, contact="10.0")
    assert of_file(path, contact="10.0", damping=Rayleigh(ratio=0.01)).mechanical_size == 3
    path.write_text(LARGE + card("DMIG", "K4AAX", 0, 6, 2))  # as it is punched of a structure without any
    assert of_file(path, contact="10.0").mechanical_size == 3
