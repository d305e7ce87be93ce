"""Which blocks agree: on linear problems whose answer is known."""

import numpy as np
import pytest

from perception.plane.selection import Equations, reweigh, search_blocks, select_blocks

BLOCKS, PIXELS, UNKNOWNS, COLUMNS = 100, 64, 5, 10


def problem(
    theta: np.ndarray,
    noise: float = 1.0,
    offsets: float = 0.0,
    foreign: np.ndarray | None = None,
    seed: int = 0,
) -> Equations:
    """r = J θ + noise, block by block; the last unknown is an offset; `foreign` blocks follow another θ."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(BLOCKS, PIXELS, UNKNOWNS))
    jacobian[..., -1] = 1
    solution = np.tile(theta, (BLOCKS, 1))
    if foreign is not None:
        solution[foreign] += 1.5
    right = np.einsum("bpu,bu->bp", jacobian, solution)
    right += rng.normal(0, noise, right.shape) + rng.normal(0, offsets, (BLOCKS, 1))
    return Equations(
        np.einsum("bpu,bpw->buw", jacobian, jacobian).reshape(BLOCKS, -1),
        np.einsum("bpu,bp->bu", jacobian, right),
        np.einsum("bp,bp->b", right, right),
        PIXELS,
        np.ones(BLOCKS, bool),
        np.zeros(BLOCKS),
    )


THETA = np.array([0.3, -0.2, 0.1, 0.4, 2.0])


def test_residuals_of_a_solution_are_those_of_the_pixels() -> None:
    equations = problem(THETA, noise=2.0)
    # Mean squares of 64 normal numbers of variance 4 average 4 over 100 blocks; .07 is their standard error.
    assert equations.residual(THETA).mean() == pytest.approx(4.0, abs=0.25)


def test_all_blocks_of_one_plane_agree() -> None:
    found = select_blocks(problem(THETA))
    assert found.agreeing > 95
    # 6400 equations of unit noise: standard deviation .0125 each.
    assert found.solution == pytest.approx(THETA, abs=0.05)


def test_a_fifth_of_foreign_blocks_is_left_out_by_weights_alone() -> None:
    foreign = np.zeros(BLOCKS, bool)
    foreign[:20] = True
    equations = problem(THETA, foreign=foreign)
    found = reweigh(equations, select_blocks(equations).following)
    assert found.solution == pytest.approx(THETA, abs=0.06)
    assert found.following[foreign].max() == 0
    assert found.following[~foreign].min() > 0.3


def test_a_search_finds_the_plane_of_sixty_per_cent() -> None:
    # Forty blocks that touch, where the weights alone settle between the two planes.
    foreign = np.zeros((10, COLUMNS), bool)
    foreign[:, :4] = True
    equations = problem(THETA, foreign=foreign.ravel())
    found = search_blocks(equations, COLUMNS, select_blocks(equations))
    assert found.solution == pytest.approx(THETA, abs=0.06)
    assert found.following[foreign.ravel()].max() == 0


def test_blocks_that_are_not_seen_say_nothing() -> None:
    equations = problem(THETA)
    seen = np.arange(BLOCKS) >= 50
    gone = Equations(
        equations.gram,
        np.where(seen[:, None], equations.right, 1e9),
        equations.energy,
        PIXELS,
        seen,
        equations.tolerance,
    )
    assert select_blocks(gone).solution == pytest.approx(THETA, abs=0.07)


def test_offsets_of_their_own_take_up_light_that_falls_unevenly() -> None:
    equations = problem(THETA, noise=0.5, offsets=3.0)
    without, with_own = select_blocks(equations), select_blocks(equations.with_own_offsets())
    assert without.agreeing < 60
    assert with_own.agreeing > 85
    assert with_own.solution[:-1] == pytest.approx(THETA[:-1], abs=0.03)


def test_an_unknown_that_nothing_is_known_of_stays_zero() -> None:
    equations = problem(THETA)
    gram = equations.gram.reshape(BLOCKS, UNKNOWNS, UNKNOWNS).copy()
    gram[:, 1], gram[:, :, 1] = 0, 0
    right = equations.right.copy()
    right[:, 1] = 0
    blind = Equations(
        gram.reshape(BLOCKS, -1), right, equations.energy, PIXELS, equations.seen, equations.tolerance
    )
    assert select_blocks(blind).solution[1] == 0
