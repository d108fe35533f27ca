import re
from dataclasses import replace
from pathlib import Path

import pytest

from freepath.compose import kernel_files, source
from freepath.compose.kernel_files import TrackerFile, functions, split_front_matter
from freepath.compose.light_paths import Effects
from freepath.compose.source import Source, Structure, combined_hash, compose, numbers_of
from freepath.errors import CatalogError

MINE = TrackerFile("mine", "\n\n\n/* line 4 */\nstatic void step(void) {}\n")
DELTA = {
    "tracker": MINE,
    "needs": frozenset({"majorant"}),
    "estimand": "transmittance",
    "medium": "homogeneous",
    "medium_numbers": ("sigma_t",),
    "majorant": "global",
    "majorant_numbers": ("sigma_t",),
    "lanes": 16,
    "arithmetic": "strict",
}
GRID = ("nx", "ny", "nz", "cells_per_x", "cells_per_y", "cells_per_z")


def composed(**changes):
    return compose(Structure(**DELTA | changes)).text


def files_of(text):
    """The files that a source names, in their order."""
    return list(dict.fromkeys(re.findall(r'#line \d+ "(.+\.cl)"', text)))


def test_a_source_has_what_the_case_needs_and_nothing_else():
    assert files_of(composed()) == [
        "lanes/vector.cl",
        "lanes/common.cl",
        "math/log_polynomial.cl",
        "lanes/rng.cl",
        "lanes/ray.cl",
        "score/transmittance.cl",
        "score/count_off.cl",
        "media/homogeneous.cl",
        "lanes/path.cl",
        "score/channels_one.cl",
        "walk/majorant_global.cl",
        "trackers/mine.cl",
        "score/tally.cl",
        "score/record_nothing.cl",
        "main.cl",
    ]


@pytest.mark.parametrize(
    ("changes", "added", "dropped"),
    [
        ({"lanes": 1}, {"lanes/scalar.cl"}, {"lanes/vector.cl"}),
        ({"count": True}, {"score/count_on.cl"}, {"score/count_off.cl"}),
        ({"record": True}, {"score/record_samples.cl"}, {"score/record_nothing.cl"}),
        ({"logarithm": "builtin"}, {"math/log_builtin.cl"}, {"math/log_polynomial.cl"}),
        ({"arithmetic": "double"}, {"math/log_builtin.cl"}, {"math/log_polynomial.cl"}),
        ({"estimand": "free_path"}, {"score/free_path.cl"}, {"score/transmittance.cl"}),
        ({"needs": frozenset()}, set(), {"walk/majorant_global.cl"}),
        (
            {"majorant": "grid", "majorant_numbers": GRID},
            {"walk/majorant_cell_by_cell.cl", "walk/grid.cl", "walk/dda.cl"},
            {"walk/majorant_global.cl"},
        ),
        (
            {"needs": frozenset({"closed_form"})},
            {"media/closed_form_homogeneous.cl"},
            {"walk/majorant_global.cl"},
        ),
        (
            {"needs": frozenset({"cells"})},
            {"media/cells_homogeneous.cl"},
            {"walk/majorant_global.cl"},
        ),
    ],
)
def test_a_choice_exchanges_files(changes, added, dropped):
    before, after = set(files_of(composed())), set(files_of(composed(**changes)))
    assert after - before >= added
    assert before - after == dropped


def test_a_file_that_two_others_use_is_there_once_and_before_them():
    both = composed(
        needs=frozenset({"majorant", "cells"}),
        majorant="grid",
        majorant_numbers=GRID,
        medium="grid_trilinear",
        medium_numbers=("nx", "ny", "nz"),
    )
    assert both.count('#line 1 "walk/dda.cl"') == 1
    order = files_of(both)
    assert order.index("walk/dda.cl") < order.index("walk/grid.cl")
    assert order.index("walk/dda.cl") < order.index("media/cells_grid_trilinear.cl")


def test_what_a_tracker_uses_is_there_once_and_before_it():
    files = files_of(composed(tracker=replace(MINE, uses=("math/newton", "math/symmetric_means"))))
    assert files[-5] == "math/symmetric_means.cl"
    # the walk uses that one too
    by_newton = {"needs": frozenset({"closed_form"}), "medium": "cosine"}
    files = files_of(composed(tracker=replace(MINE, uses=("math/newton",)), **by_newton))
    assert files.count("math/newton.cl") == 1


def test_lines_are_numbered_as_in_their_files():
    text = composed(needs=frozenset({"cells"}), medium="layered", medium_numbers=("layers",))
    name, line = "", 0
    seen = {}
    for content in text.splitlines():
        directive = re.fullmatch(r'#line (\d+)(?: "(.+)")?', content)
        if directive:
            line, name = int(directive[1]), directive[2] or name
        else:
            seen[name, line] = content
            line += 1
    assert seen["trackers/mine.cl", 4] == "/* line 4 */"
    for (file, number), content in seen.items():
        if file.endswith(".cl") and not file.startswith("trackers/"):
            code = kernel_files.read(file.removesuffix(".cl")).code.split("\n")
            assert code[number - 1] == content, (file, number)


def test_numbers_are_declared_in_the_order_in_which_they_are_given():
    tracker = replace(MINE, numbers=("step",))
    structure = Structure(**DELTA | {"tracker": tracker, "medium_numbers": ("a", "b")})
    declared = re.findall(
        r"typedef struct \{ SCALAR (.+); \} (\w+)Numbers;", compose(structure).text
    )
    assert [group for _, group in declared] == ["Box", "Medium", "Majorant", "Tracker"]
    names = [name for names, _ in declared for name in names.split(", ")]
    assert names == ["extent_x", "extent_y", "extent_z", "a", "b", "sigma_t", "step"]
    values = numbers_of(
        structure, [1.0, 2.0, 3.0], {"b": 5.0, "a": 4.0}, {"sigma_t": 6.0}, [1.0], {"step": 7.0}
    )
    assert values == [1, 2, 3, 4, 5, 6, 7]


def test_a_tracker_without_a_majorant_is_given_no_numbers_of_one():
    structure = Structure(**DELTA | {"needs": frozenset()})
    assert "MajorantNumbers" not in compose(structure).text
    assert numbers_of(structure, [1.0, 1.0, 1.0], {"sigma_t": 2.0}, {}, [1.0], {}) == [1, 1, 1, 2]


def test_choices_become_defines():
    choices = (("placement", "end", ("start", "end")), ("order", "2", ("1", "2")))
    text = composed(tracker=replace(MINE, choices=choices))
    for line in (
        "#define PLACEMENT_START 0",
        "#define PLACEMENT_END 1",
        "#define PLACEMENT PLACEMENT_END",
        "#define ORDER ORDER_2",
    ):
        assert line in text.splitlines()


def test_the_state_of_a_path_is_that_of_its_walk_and_its_tracker():
    tracker = replace(MINE, state=(("best", "real"), ("hit", "mask")))
    text = composed(majorant="grid", majorant_numbers=GRID, tracker=tracker)
    for declared in ("index cell;", "real best;", "mask hit;"):
        assert f"    {declared}\n" in text
    assert "into->best = choose(where, from->best, into->best);" in text


def test_several_channels_have_a_weight_each():
    text = composed(chromatic=True, channels=3)
    assert "score/channels_several.cl" in files_of(text)
    assert "#define CHANNELS 3" in text
    assert "    real throughput[CHANNELS];\n" in text
    taken = "into->throughput[c] = choose(where, from->throughput[c], into->throughput[c]);"
    assert taken in text
    structure = Structure(**DELTA | {"chromatic": True, "channels": 3})
    values = numbers_of(structure, [1, 1, 1], {"sigma_t": 2}, {"sigma_t": 3}, [4, 6, 5], {})
    assert values == [1, 1, 1, 2, 3, 4, 6, 5, 6]


def test_a_tracker_may_not_take_the_state_of_its_walk():
    with pytest.raises(CatalogError, match=r"trackers/mine\.cl: .*'cell'"):
        tracker = replace(MINE, state=(("cell", "index"),))
        composed(majorant="grid", majorant_numbers=GRID, tracker=tracker)


def test_the_hash_tells_sources_and_options_apart():
    strict = compose(Structure(**DELTA))
    fast = compose(Structure(**DELTA | {"arithmetic": "fast"}))
    assert strict.text == fast.text
    assert len({strict.sha256, fast.sha256, strict.unoptimised().sha256}) == 3
    assert compose(Structure(**DELTA)).sha256 == strict.sha256
    assert strict.unoptimised().options == (*strict.options, "-cl-opt-disable")
    assert strict.unoptimised().text == strict.text


def test_relaxed_arithmetic_is_only_where_it_is_asked_for():
    for arithmetic, options in source.BUILD_OPTIONS.items():
        assert ("-cl-fast-relaxed-math" in options) == (arithmetic == "fast")
    assert "cl_khr_fp64" in composed(arithmetic="double")
    assert "cl_khr_fp64" not in composed(arithmetic="fast")


def test_a_hash_of_parts_knows_where_they_end():
    assert combined_hash("ab", "c") != combined_hash("a", "bc")
    assert combined_hash("a") == combined_hash(b"a")
    assert Source("a", ("b",)).sha256 == combined_hash("a", "b")


def test_front_matter_and_code_keep_their_lines():
    text = "\n/*---\ntitle: x\n---*/\n/* code */\n"
    front, code = split_front_matter(text)
    assert front.split("\n")[2] == "title: x"
    assert code.split("\n")[4] == "/* code */"
    assert code.strip() == "/* code */"


def test_a_file_without_front_matter_is_all_code():
    assert split_front_matter("int x; /*--- no ---*/\n") == (None, "int x; /*--- no ---*/\n")
    assert split_front_matter("") == (None, "")


def radiance(**changes):
    """A source of radiance with these effects."""
    names, tracker = changes.pop("names"), changes.pop("tracker", MINE)
    space = {"space": {"to_world": [1.0] * 9}} if "scattering" in names else {}
    effects = Effects(
        names=names,
        channels=1,
        chromatic=False,
        phase="isotropic",
        tracker=tracker,
        values={"optics": {"albedo": [0.5], "scatterings": 1}} | space,
        **changes,
    )
    return composed(estimand="radiance", paths=effects, tracker=tracker)


def test_single_flights_have_nothing_of_paths():
    assert not [name for name in files_of(composed()) if name.startswith("light/")]


def test_a_source_has_the_effects_that_it_needs_and_no_other():
    bare = files_of(radiance(names=()))
    assert [name for name in bare if name.startswith("light/")] == [
        "light/paths.cl",
    ]
    for name in ("emission", "environment"):
        added = set(files_of(radiance(names=(name,)))) - set(bare)
        assert added == {f"light/{name}.cl"}
    scattering = set(files_of(radiance(names=("scattering",)))) - set(bare)
    assert scattering == {
        "light/around.cl",
        "light/direction.cl",
        "light/new_direction.cl",
        "light/until_last_light.cl",
        "light/no_roulette.cl",
        "light/scattering.cl",
        "math/circle_polynomial.cl",
        "light/phase_isotropic.cl",
    }


DECIDES = """static real share(const real x) { return x; }
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here,
                         const real sigma_t)
{
#if MODE == MODE_FAST
    splat(path, share(scene->tracker.step), path->t, sampled_depth(rng), here);
#endif
}
"""
CHOICES = (("mode", "fast", ("slow", "fast")),)


def test_a_tracker_that_decides_has_the_begin_and_the_step_of_the_walk():
    names = files_of(composed(tracker=TrackerFile("mine", DECIDES)))
    after = names.index("trackers/mine.cl")
    assert names[after : after + 3] == ["trackers/mine.cl", "walk/begin.cl", "walk/step.cl"]
    own = TrackerFile("mine", f"void begin(void) {{}}\n{DECIDES}")
    assert "walk/begin.cl" not in files_of(composed(tracker=own))
    assert "walk/begin.cl" not in files_of(composed()) + files_of(radiance(names=()))


def test_functions_have_the_names_by_which_they_are_called():
    """In the text itself: nothing but what a tracker defines is a macro, and nothing is undone."""
    own = TrackerFile("mine", DECIDES, choices=CHOICES)
    other = TrackerFile("mine", DECIDES, choices=(("mode", "slow", ("slow", "fast")),))
    names = ("point_light", "scattering")
    for modes in (False, True):
        text = radiance(names=names, tracker=own, shadow=other, modes=modes)
        assert "#undef" not in text
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        defined = [name for name in re.findall(r"(?m)^static [^;{}=]*?\b(\w+)\(", code)]
        assert len(set(defined)) == len(defined)
        assert {"flight_share", "shadow_share", "begin", "step", "flight_step"} <= set(defined)
        assert ("shadow_step" in defined) != modes
        assert "splat(path, flight_share(scene->tracker.step), path->t, sampled_depth(rng)" in text
        assert (
            "shadow_splat(path, shadow_share(scene->shadow_tracker.step), path->t, shadow_s" in text
        )
        assert "#define MODE MODE_FAST\n" in text
        assert "#define SHADOW_MODE SHADOW_MODE_SLOW\n" in text
        assert "#if SHADOW_MODE == SHADOW_MODE_FAST\n" in text


def test_a_lane_keeps_its_path_while_it_flies_a_shadow_ray():
    mine = TrackerFile("mine", DECIDES, choices=CHOICES)
    given = {"names": ("point_light", "scattering"), "tracker": mine, "shadow": mine}
    text = radiance(modes=True, **given)
    for place in ("ray", "t", "weight", "state.collected"):
        held = f"path->state.held_{place.removeprefix('state.')}"
        kind, here = ("take_ray(&{}, &{}, where)", f"path->{place}")
        if place != "ray":
            kind = "{0} = choose(where, {1}, {0})"
        assert kind.format(held, here) in text
        assert kind.format(here, held) in text
    assert "held_" not in radiance(**given)


FUNCTIONS = """/* void no(void) {} */
static int a(int b) { return b; }
// int c(void) {
void d(
  int e)
{
    if (x) {
    }
}
static int later(void);
else if (z) {
#define f(x) {
"""


def test_what_a_file_defines():
    assert functions(FUNCTIONS) == {"a", "d"}


def test_paths_know_the_step_cap():
    """They restore their ray where the main loop cuts them off."""
    text = radiance(names=("scattering",))
    cap = re.search(r"#define MOST_STEPS \(1 << (\d+)\)", text)
    runner = (Path(source.__file__).parents[1] / "measure" / "runner.py").read_text("utf-8")
    assert f"STEP_CAP = 1 << {cap[1]}\n" in runner
