import numpy as np
import pytest
from freepath.config.models import MAJORANTS
from freepath.majorants import NUMBERS, build, cells_of

EXTENT = np.array([8.0, 4.0, 2.0])
GLOBAL = MAJORANTS["global"]()
GRID = MAJORANTS["grid"](resolution=[4, 2, 5])


def test_every_kind_of_a_config_has_its_numbers():
    assert set(NUMBERS) == set(MAJORANTS)


def test_a_global_majorant_is_one_number():
    found = build(GLOBAL, np.full((1, 1, 1), 3.0), EXTENT, 2.5)
    assert found.numbers == {"sigma_t": 7.5}
    assert found.data is None
    assert tuple(found.numbers) == NUMBERS["global"]
    assert cells_of(GLOBAL) == (1, 1, 1)


def test_a_grid_has_its_cells_and_a_margin():
    upper = np.arange(40.0).reshape(5, 2, 4)
    found = build(GRID, upper, EXTENT, 0.5)
    assert cells_of(GRID) == (4, 2, 5)
    assert tuple(found.numbers) == NUMBERS["grid"]
    assert tuple(found.numbers.values()) == (4, 2, 5, 0.5, 0.5, 2.5)
    assert found.data.dtype == np.float32
    assert found.data.shape == (7, 4, 6)
    assert (found.data[1:-1, 1:-1, 1:-1] == upper * 0.5).all()
    # the margin repeats its neighbours, so that a step too far finds what was there before
    assert (found.data[0, 1:-1, 1:-1] == upper[0] * 0.5).all()
    assert found.data[-1, -1, -1] == upper[-1, -1, -1] * 0.5


@pytest.mark.parametrize("tightness", [1.0, 1.7])
def test_rounding_to_float_never_loosens_the_hold(tightness):
    """A majorant in float32 below the extinction in float32 would be a violation by rounding."""
    values = np.random.default_rng(2).random((5, 2, 4))
    grid = build(GRID, values, EXTENT, tightness)
    assert (grid.data[1:-1, 1:-1, 1:-1] >= values.astype(np.float32)).all()
