import numpy as np
import pytest

from freepath.config.models import MAJORANTS
from freepath.scene.majorants import build, cells_of, numbers_of
from freepath.scene.media.formulas import Linear
from freepath.scene.octree import leaf_sizes, over_leaves

MEDIUM = Linear(0.0, 8.0, (8.0, 4.0, 2.0))
GLOBAL = MAJORANTS["global"]()
GRID = MAJORANTS["grid"](resolution=[4, 2, 5])
OCTREE = MAJORANTS["octree"](resolution=4, slack=0.25)
NEEDS = frozenset({"majorant"})
CONTROLLED = frozenset({"majorant", "control"})


def made(model, tightness=1.0, control=None):
    return build(model, MEDIUM, MEDIUM.bounds(cells_of(model)), tightness, control)


@pytest.mark.parametrize("model", [GLOBAL, GRID, OCTREE])
@pytest.mark.parametrize("needs", [NEEDS, CONTROLLED])
def test_a_kernel_reads_the_numbers_that_are_made(model, needs):
    control = {"control": "minorant", "share": 1.0} if needs == CONTROLLED else None
    assert tuple(made(model, control=control).numbers) == numbers_of(model, needs)


def test_a_global_majorant_is_one_number():
    found = made(GLOBAL, 2.5)
    assert found.numbers == {"sigma_t": 20.0}
    assert found.data is None


def test_a_grid_has_its_cells_and_a_margin():
    upper = MEDIUM.bounds(cells_of(GRID))[1]
    found = made(GRID, 0.5)
    assert tuple(found.numbers.values()) == (4, 2, 5, 0.5, 0.5, 2.5, 6 * 4 * 7)
    assert found.data.dtype == np.float32
    assert found.data.shape == (1, 7, 4, 6)
    assert (found.data[0, 1:-1, 1:-1, 1:-1] == (upper * 0.5).astype(np.float32)).all()
    # the margin repeats its neighbours, so that a step too far finds what was there before
    assert (found.data[0, 0, 1:-1, 1:-1] == found.data[0, 1, 1:-1, 1:-1]).all()


@pytest.mark.parametrize("tightness", [1.0, 1.7])
def test_rounding_to_float_never_loosens_the_hold(tightness):
    """A majorant in float32 below the extinction in float32 would be a violation by rounding."""
    upper = MEDIUM.bounds(cells_of(GRID))[1]
    found = made(GRID, tightness).data[0, 1:-1, 1:-1, 1:-1]
    assert (found >= upper.astype(np.float32)).all()


@pytest.mark.parametrize(
    ("control", "value"), [("minorant", 0.0), ("middle", 4.0), ("mean", 4.0), ("number", 1.0)]
)
@pytest.mark.parametrize("share", [0.5, 1.5])
def test_a_control_and_the_bound_of_what_is_left(control, value, share):
    numbers = made(GLOBAL, 2.0, {"control": control, "share": share}).numbers
    split_off = value * share
    assert numbers["control"] == pytest.approx(split_off)
    assert numbers["residual"] == pytest.approx(2.0 * max(8.0 - split_off, split_off))


def test_a_control_of_each_cell_bounds_the_residual_there():
    lower, upper = MEDIUM.bounds(cells_of(GRID))
    residual, control = made(GRID, 1.0, {"control": "middle", "share": 1.0}).data[
        :, 1:-1, 1:-1, 1:-1
    ]
    assert np.allclose(control, (lower + upper) / 2)
    assert np.allclose(residual, (upper - lower) / 2)


def test_the_excess_of_a_control_is_told():
    assert made(GRID, 1.0, {"control": "minorant", "share": 1.0}).control_excess == 0.0
    assert made(GRID, 1.0, {"control": "middle", "share": 1.0}).control_excess > 0.05


def test_the_means_of_cells_are_those_of_the_medium():
    control = made(GRID, 1.0, {"control": "mean", "share": 1.0}).data[1, 1:-1, 1:-1, 1:-1]
    assert np.allclose(control[:, 0, 0], [0.8, 2.4, 4.0, 5.6, 7.2])


def test_like_cells_are_joined_and_unlike_ones_are_not():
    majorants = np.ones((4, 4, 4))
    majorants[0, 0, 0] = 9.0
    sizes = leaf_sizes(majorants, 0.25)
    assert (sizes[:2, :2, :2] == 1).all()
    assert (sizes[2:] == 2).all()
    assert (leaf_sizes(np.ones((4, 4, 4)), 0.0) == 4).all()
    assert (leaf_sizes(np.zeros((4, 4, 4)), 0.0) == 4).all()


def test_a_leaf_costs_no_more_than_the_slack():
    majorants = np.random.default_rng(1).random((16, 16, 16)) ** 4
    for slack in (0.0, 0.5, 2.0):
        sizes = leaf_sizes(majorants, slack)
        joined = over_leaves(majorants, sizes, np.max)
        assert (joined >= majorants).all()
        levels = np.log2(sizes.max())
        assert joined.sum() <= (1 + slack) ** levels * majorants.sum() + 1e-9


def test_an_octree_packs_majorants_sizes_and_controls():
    found = made(OCTREE, 1.0, {"control": "minorant", "share": 1.0})
    majorants, sizes, controls = found.data
    assert found.numbers["cells"] == 64
    assert set(np.unique(sizes)) <= {1.0, 2.0, 4.0}
    assert (majorants >= 0).all()
    assert (controls >= 0).all()
