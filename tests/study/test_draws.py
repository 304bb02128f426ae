"""Drawn zips: which values they have, and what stays where a study asks for more of them."""

import numpy as np
import pytest
from scipy.stats import qmc

from studies import SCENE
from workflow.cases import arrange, case_hashes
from workflow.study import Study, parse_study, resolved_values

PATHS = ("scene.casing.gap", "alpha")


def design(sample: str, points: int, seed: int = 1) -> Study:
    ranges = "{scene.casing.gap: [15 um, 25 um], alpha: {log: [1, 30]}}"
    zipped = f"{{sample: {sample}, points: {points}, seed: {seed}, of: {ranges}}}"
    return parse_study(f"study: a\n{SCENE}\naxes: {{h: 1e-3}}\nzip: {{design: {zipped}}}\n", "f")


def columns(study: Study) -> np.ndarray:
    (dimension,) = study.dimensions
    assert dimension.name == "design"
    assert tuple(axis.path for axis in dimension.axes) == PATHS
    return np.array([axis.values for axis in dimension.axes]).T


def in_range(shares: np.ndarray) -> np.ndarray:
    return np.stack([15e-6 + 1e-5 * shares[..., 0], 30 ** shares[..., 1]], axis=-1)


def test_random_values_are_those_of_the_seed() -> None:
    assert columns(design("random", 5)) == pytest.approx(in_range(np.random.default_rng(1).random((5, 2))), rel=1e-11)
    assert np.all(columns(design("random", 5, 2)) != columns(design("random", 5)))


def test_a_hypercube_has_each_number_once_in_each_part() -> None:
    drawn = columns(design("latin_hypercube", 10))
    assert drawn == pytest.approx(in_range(qmc.LatinHypercube(2, seed=1).random(10)), rel=1e-11)
    gap, alpha = (drawn[:, 0] - 15e-6) / 1e-5, np.log(drawn[:, 1]) / np.log(30)
    for shares in (gap, alpha):
        assert sorted(np.floor(10 * shares)) == list(range(10))


def test_sobol_indices_have_two_matrices_and_one_more_for_each_number() -> None:
    sequence = qmc.Sobol(4, bits=64, seed=1).random(8)
    a, b = sequence[:, :2], sequence[:, 2:]
    mixed = np.stack([a, b, np.stack([b[:, 0], a[:, 1]], 1), np.stack([a[:, 0], b[:, 1]], 1)], axis=1)
    study = design("sobol_indices", 8)
    assert columns(study) == pytest.approx(in_range(mixed.reshape(32, 2)), rel=1e-11)
    assert study.dimensions[0].drawn.matrices == ("A", "B", *PATHS)


@pytest.mark.parametrize("sample", ["random", "sobol_indices"])
def test_more_points_keep_the_first(sample: str) -> None:
    few, many = design(sample, 8), design(sample, 8).with_({"zip.design.points": 16})
    assert "points: 16" in many.text
    assert np.array_equal(columns(many)[: len(columns(few))], columns(few))
    hashes = [case_hashes(arrange(study)) for study in (few, many)]
    assert np.array_equal(hashes[1][: len(hashes[0])], hashes[0])


def test_the_plan_names_ranges() -> None:
    study = design("random", 300)
    texts = {one.path: one.text for one in resolved_values(study, arrange(study).settings(0))}
    assert texts["scene.casing.gap"] == "15 µm to 25 µm, drawn"
    assert texts["alpha"] == "1 W/N to 30 W/N, drawn in the logarithm"
    assert study.resolved()["dimensions"][0]["drawn"]["sample"] == "random"
