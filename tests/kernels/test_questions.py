"""configs/questions: the sign of each answer, in lookups until an error of 1 %: without a clock."""

import re

import numpy as np
import pytest

from freepath import config
from freepath.cases import plan
from freepath.config.base import Kind
from freepath.paths import CONFIGS

SAMPLES = 512
ERROR = 0.01
# (question, a case of it, another that needs more lookups; parts of their names)
ANSWERS = [
    ("null_scattering_or_marching", "t1/biased_march", "t1/ratio"),
    ("null_or_marching_paths", "grid-8/t1/delta", "t1/production_march"),
    ("how_loose_may_a_majorant_be", "t1/delta", "t4/delta"),
    ("how_fine_a_majorant_grid", "grid-16/t1/ratio", "grid-4/t1/ratio"),
    ("are_minorants_worth_it", "linear.*decomposition", "linear.*/delta"),
    ("may_a_majorant_not_bound", "t0.5/delta", "t1/delta"),
    ("delta_or_cells", "hybrid", "t1/delta"),
    ("when_to_choose_scattering", "0.01.*resampled-", "0.01.*analytic/delta"),
    ("when_to_choose_scattering", "us-4-.*analytic/delta", "us-4-.*resampled-"),
]


@pytest.fixture(scope="module")
def cost(rig):
    """Lookups of a ray until its RMSE is 1 % of the reference; infinite where the bias is more."""
    known, costs = rig.catalog, {}

    def cost_of(question, part):
        loaded = config.load(CONFIGS / "questions" / f"{question}.yaml", known.parameter_models())
        (case,) = [case for case in plan.expand(loaded, known) if re.search(part, case.name)]
        if case.name not in costs:
            costs[case.name] = lookups_until(rig, case)
        return costs[case.name]

    return cost_of


def lookups_until(rig, case):
    axes = {n: v.as_dict() if isinstance(v, Kind) else v for n, v in case.point.items()}
    given = {name: value for name, value in axes.items() if value not in (None, ())}
    flight = rig.flight(rays=case.rays.as_dict(), record=False, **given | {"lanes": 16})
    one, reference = flight.run(SAMPLES), flight.reference()
    noise = one.moments.variance / one.moments.count
    square = max(0.0, float(np.mean((one.moments.mean - reference) ** 2 - noise)))
    if square < 9.0 * float(np.sqrt(2.0 * np.mean(noise**2) / len(noise))):
        square = 0.0  # noise explains it
    left = (ERROR * reference.mean()) ** 2 - square
    lookups = one.counters["lookups"] / one.samples
    return lookups * max(1.0, one.variance / left) if left > 0.0 else np.inf


@pytest.mark.parametrize(("question", "better", "worse"), ANSWERS)
def test_sign(cost, question, better, worse):
    """By a tenth at least: more than the noise of either."""
    assert 1.1 * cost(question, better) < cost(question, worse)


def test_every_question_has_an_answer():
    assert {path.stem for path in (CONFIGS / "questions").iterdir()} == {q for q, *_ in ANSWERS}
