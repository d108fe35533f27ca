"""Reports: their numbers, their formats, and the page in a real browser."""

import csv
import itertools
import json
import shutil
import time

import pytest

from freepath.cli import main
from freepath.errors import FreepathError
from freepath.measure import pictures
from freepath.results.folder import CONFIRM_COLUMNS
from freepath.show.report import Choice, load, write
from freepath.show.report.pictures import picture
from freepath.show.report.text import markdown, sentences
from support.many import many
from support.rows import EVIL, ROW, result_of, row_of

CONFIRMED = dict.fromkeys(CONFIRM_COLUMNS, "") | {
    "case_id": "0",
    "case": ROW["case"],
    "device": "a [b] <c>",
    "platform": "p",
    "reference": "0.5",
    "samples_per_ray": "10",
    "time_s": "1e-5",
    "rmse_predicted": "0.1",
    "rmse_measured": "0.102",
    "rmse_low": "0.1",
    "rmse_high": "0.104",
}


@pytest.fixture
def result(tmp_path):
    rows = [
        row_of(10 * i + j, tracker, tightness, 1e-6 * (1 + i + j))
        for i, tracker in enumerate(("delta", "ratio", EVIL.replace("/", "")))
        for j, tightness in enumerate((1.0, 2.0, 4.0))
    ]
    rows[-1] |= {"variance_noise": "0.5", "time_to_10pct_s": rows[-1]["time_per_sample_s"]}
    rows.append(row_of(99, "march", status="mismatch", reason="off"))
    other = [row | {"device": "other"} for row in rows[:3]]
    return result_of(tmp_path / "result", rows + other, [CONFIRMED])


def test_relative_numbers_and_times(result):
    report = load([result])
    first = report.rows[0]
    assert (first["v"], first["vt"], first["vl"]) == (1.0, 1e-6, 5.0)
    assert (first["t10"], first["t01"]) == (1e-4, "never")
    assert first["lo"] == 1e-6
    assert report.confirmed[0]["ratio"] == pytest.approx(1.02)
    assert [row["v"] for row in report.rows if row["status"] == "mismatch"] == [None]


@pytest.mark.parametrize(
    "chart",
    ["cost", "pareto", "tightness-time", "tightness-lookups", "lookups", "occupancy", "devices"],
)
def test_every_chart_is_drawn(result, tmp_path, chart):
    for name, start in (("p.svg", b"<svg"), ("p.png", b"\x89PNG")):
        path = tmp_path / name
        assert main(["report", str(result), "--chart", chart, "-o", str(path)]) == 0
        assert path.read_bytes().startswith(start)
    assert "<script" not in (tmp_path / "p.svg").read_text()


def drawn_lines(panel):
    return next(layer for layer in panel["layer"] if layer["mark"]["type"] == "line")["encoding"]


@pytest.mark.parametrize("chart", ["cost", "tightness-time", "pareto"])
def test_devices_differ_in_their_lines(tmp_path, chart):
    name = "pthread-a processor with a long name"
    versions = ("3.0-rc2 of a wheel", "3.1 of a distribution")
    rows = [
        row_of(10 * i + j, tracker, j + 1.0, device=name, platform=platform, driver_version=version)
        for i, (tracker, version) in enumerate(itertools.product(("delta", "ratio"), versions))
        for j, platform in enumerate(["Portable Computing Language"] * 2)
    ]
    report = load([result_of(tmp_path / "two", rows)])
    (panel,) = picture(report, chart).to_dict()["concat"]
    dash = drawn_lines(panel)["strokeDash"]
    assert dash["field"] == "device"
    assert dash["scale"]["domain"] == report.values("device")
    assert dash["scale"]["range"][0] != dash["scale"]["range"][1]
    # cut as they are for a legend, names still differ
    cut = json.loads(dash["legend"]["labelExpr"].removesuffix("[datum.label]").strip("()"))
    assert list(cut) == report.values("device")
    assert len(set(cut.values())) == 2
    assert all(len(shown) < 50 for shown in cut.values())
    svg = tmp_path / "p.svg"
    write([tmp_path / "two"], svg, None, Choice(chart))
    assert all(shown in svg.read_text() for shown in cut.values())
    # a single device leaves the dashes to the majorants, and needs no legend
    alone = load([result_of(tmp_path / "one", [r for r in rows if r["driver_version"][2] == "0"])])
    (panel,) = picture(alone, chart).to_dict()["concat"]
    assert drawn_lines(panel).get("strokeDash", {}).get("field") != "device"


def test_lights_are_told_apart_and_shown_side_by_side(tmp_path, result):
    places = ("point-0.5x0.5x2", "point-0.5x0.5x9")
    rows = [
        row_of(i, tracker, light=light, scatterings="1")
        for i, (tracker, light) in enumerate(itertools.product(("delta", "joint"), places))
    ]
    lit = result_of(tmp_path / "lit", rows)
    assert all(light in text for text, light in zip(load([lit]).values("q"), places, strict=True))
    chart = picture(load([lit]), "lights").to_dict()
    (panel,) = chart["concat"]
    assert panel["encoding"]["x"]["sort"] == list(places)
    assert len(next(iter(chart["datasets"].values()))) == 4
    with pytest.raises(FreepathError, match="nothing that the chart 'lights'"):
        picture(load([result]), "lights")


def test_markdown_names_the_soonest(result):
    text = markdown(load([result]))
    line = next(line for line in text.splitlines() if line.startswith("| transmittance, cloud"))
    assert "10 ms, delta, global x1" in line
    assert "<script" not in text.replace("\\<", "")


def test_what_is_known_roughly_is_marked_and_ties_are_counted(tmp_path):
    """Other times of the ladder are those of a single sample, in which there is no variance."""
    rough = {"variance_noise": "0.4", "time_to_10pct_s": "1e-06", "time_to_1pct_s": "0.0099"}
    rows = [row_of(1, "delta", **rough), row_of(2, "ratio"), row_of(3, "split", seconds=1e-5)]
    report = load([result_of(tmp_path / "result", rows)])
    assert [row["rough"] for row in report.rows] == [["t1"], [], []]
    lines = markdown(report).splitlines()
    soonest = next(line for line in lines if line.startswith("| transmittance, cloud"))
    assert "| ~9.9 ms, delta, global x1 (not significantly slower: 1 more) |" in soonest
    (case,) = (line for line in lines if line.startswith("| delta"))
    assert case.endswith("| 1 us | ~9.9 ms | never |")


def test_what_is_not_known_is_not_the_fastest(tmp_path):
    """An interval that holds 0, at a sixteenth of the time: the answer is what is known."""
    rows = [
        row_of(1, "delta"),
        row_of(2, "ratio", seconds=1e-6 / 16, variance_noise="1.43"),
        row_of(3, "split", seconds=5e-7),
        row_of(4, "march", seconds=1e-9, status="mismatch", reason="off"),
    ]
    report = load([result_of(tmp_path / "result", rows)])
    (line,) = sentences(report)
    assert line == (
        "transmittance, cloud-64, 64 rays: At 1 %: split, global, tightness 1 is 2.0 (1.9 to 2.1) "
        "times as fast as delta, global, tightness 1; not ranked, as their variance is not "
        "settled: 1; not ranked, as they failed: 1."
    )
    text = markdown(report)
    assert text.splitlines()[2] == "- " + line
    assert "| 5 ms, split, global x1 |" in text
    (case,) = (one for one in text.splitlines() if one.startswith("| ratio"))
    assert "| ?625 us |" in case
    (only,) = sentences(load([result_of(tmp_path / "other", [rows[1], rows[3]])]))
    assert "At 1 %: the variance of no case is settled; measure longer; not ranked" in only


def test_the_baseline_can_be_chosen(result, capsys):
    assert main(["report", str(result), "--baseline", "t4/delta", "--format", "md"]) == 0
    first = capsys.readouterr().out.splitlines()[2]
    assert "is 3.0 (2.9 to 3.1) times as fast as delta, global, tightness 4" in first


def test_markdown_and_what_is_asked_for_is_printed(result, capfdbinary):
    before = sorted(result.iterdir())
    for arguments, start in (
        (["--format", "md"], b"# What accuracy costs in time"),
        (["-o", "-"], b"# What accuracy costs in time"),
        (["-o", "-", "--format", "svg"], b"<svg"),
        (["-o", "-", "--format", "html"], b"<!doctype html>"),
    ):
        assert main(["report", str(result), *arguments]) == 0
        printed = capfdbinary.readouterr().out
        assert printed.startswith(start)
        assert b"wrote" not in printed.splitlines()[-1]
    assert sorted(result.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "p.eps"], "expected a name that ends in one of .html, .md, .svg, .png"),
        (["--format", "md", "-o", "p.svg"], "--format md does not fit p.svg"),
        (["--chart", "pareta", "-o", "p.svg"], "did you mean 'pareto'?"),
        (["-o", "none/p.html"], "cannot write none/p.html: No such file or directory"),
    ],
)
def test_mistakes(result, monkeypatch, tmp_path, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(result), *arguments]) == 2
    assert message in capsys.readouterr().err


def test_nothing_to_show(tmp_path, capsys):
    assert main(["report", str(tmp_path / "none")]) == 2
    assert "expected the folder of a run, with summary.csv in it" in capsys.readouterr().err
    empty = result_of(tmp_path / "empty", [ROW | {"status": "build_failed", "variance": ""}])
    assert main(["report", str(empty)]) == 2
    assert "no case that was measured" in capsys.readouterr().err


@pytest.fixture(scope="module")
def browser():
    api = pytest.importorskip("playwright.sync_api")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if not path:
        pytest.skip("no Chromium")
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def opened(browser):
    """Open a page; everything that it asks for, and every complaint, is kept."""
    contexts = []

    def opened(path, **options):
        context = browser.new_context(**options)
        contexts.append(context)
        page, complaints, asked = context.new_page(), [], []
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("dialog", lambda dialog: complaints.append("dialog"))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_function("typeof vegaEmbed === 'function'")
        page.locator("#figure-cost").scroll_into_view_if_needed()
        page.wait_for_selector("#figure-cost canvas")
        page.evaluate("freepathReady()")
        return page, complaints, asked

    yield opened
    for context in contexts:
        context.close()


def column(page, place):
    return page.locator(f"#body tr td:nth-child({place})").all_inner_texts()


def test_the_page(result, opened):
    _, path = write([result], None, None)
    page, complaints, asked = opened(path)
    assert len(column(page, 1)) == 13
    page.locator("#head th", has_text="time").click()
    times = column(page, 1 + page.locator("#head th").all_inner_texts().index("time"))
    assert times[0] == "1 us"
    page.locator("#head th", has_text="time").click()
    assert column(page, 1 + page.locator("#head th").all_inner_texts().index("time"))[0] == "5 us"
    place = 1 + page.locator("#head th").all_inner_texts().index("to 1 %")
    assert [text for text in column(page, place) if "?" in text] == ["?50 ms"]
    page.fill("#filter", "ratio -x4")
    page.wait_for_function("document.querySelectorAll('#body tr').length === 2")
    assert all("ratio" in text for text in column(page, 1))
    page.fill("#filter", "delta")
    page.wait_for_function("document.querySelectorAll('#body tr').length === 6")
    page.evaluate("freepathReady()")
    page.evaluate("document.querySelector('#figure-cost').scrollIntoView()")
    page.wait_for_timeout(300)
    page.evaluate("freepathReady()")
    box = page.locator("#figure-cost canvas").bounding_box()
    tip = page.locator("#tip:not([hidden])")
    for place in range(40):
        down = 0.25 + 0.15 * (place % 4)
        page.mouse.move(
            box["x"] + (0.1 + place / 80) * box["width"], box["y"] + down * box["height"]
        )
        page.wait_for_timeout(60)
        if tip.count():
            break
    assert "delta, global x" in tip.inner_text()
    assert complaints == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_on_a_phone(result, opened, scheme):
    _, path = write([result], None, None)
    page, complaints, _ = opened(path, viewport={"width": 390, "height": 844}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") == (scheme == "light")
    assert complaints == []


@pytest.fixture
def asked_two(tmp_path):
    """Two questions; the second one has more at stake, and a case no line of the chart reaches."""
    near = [row_of(1, "delta"), row_of(2, "ratio", seconds=5e-7)]
    far = [
        row_of(11, "delta", seconds=4e-6, medium="thick"),
        row_of(12, "ratio", seconds=4e-7, medium="thick"),
        row_of(13, "split", seconds=3e-7, medium="thick", variance_noise="1.4"),
        row_of(14, "coarse", medium="thick", bias="7.5", bias_rms="7.5", time_to_1pct_s="inf"),
    ]
    return result_of(tmp_path / "two", near + far)


def cards(page):
    return page.locator(".card").all_inner_texts()


def test_the_page_answers_first(asked_two, opened):
    """Its sentence is that of Markdown, its ratio that of the table, to the last digit."""
    _, path = write([asked_two], None, None)
    page, complaints, _ = opened(path)
    told = {
        line.split(": At")[0]: "At" + line.split(": At")[1] for line in sentences(load([asked_two]))
    }
    thick, cloud = "transmittance, thick, 64 rays", "transmittance, cloud-64, 64 rays"
    assert page.input_value("#question") == thick
    assert page.inner_text(".sentence") == told[thick]
    assert "10 (9.6 to 10) times as fast" in told[thick]
    assert "10 (9.6 to 10) times as fast" in cards(page)[1]
    heads = page.locator("#head th").all_inner_texts()
    assert heads[:5] == ["case", "to 10 %", "to 1 %", "to 0.1 %", "x baseline"]
    assert column(page, 1)[:2] == ["ratio, global x1", "delta, global x1"]
    assert column(page, 5) == ["10", "1.0", "", ""]
    page.select_option("#question", cloud)
    assert page.inner_text(".sentence") == told[cloud]
    assert column(page, 1) == ["ratio, global x1", "delta, global x1"]
    page.fill("#filter", "thick")
    page.wait_for_function(
        "document.querySelector('#count').textContent.startsWith('0 of 2 cases')"
    )
    assert page.inner_text("#count") == "0 of 2 cases; 4 of other questions match"
    header = page.locator("#head th", has_text="lookups").locator("button")
    assert header.get_attribute("title") == "mean of the counted samples"
    assert page.locator("#" + header.get_attribute("aria-describedby")).count() == 1
    assert complaints == []


def test_a_link_leads_to_a_state(asked_two, opened, browser):
    _, path = write([asked_two], None, None)
    page, _, _ = opened(path)
    page.locator("#head th", has_text="lookups").click()
    page.locator("#body tr", has_text="delta").click()
    page.fill("#filter", "-coarse")
    page.wait_for_function("location.hash.includes('filter=-coarse')")
    other = browser.new_page()
    other.goto(page.url)
    other.wait_for_selector("#body tr")
    assert other.input_value("#filter") == "-coarse"
    assert other.locator("th[aria-sort=ascending]").inner_text() == "lookups"
    assert "delta" in other.locator("tr[aria-selected=true]").inner_text()
    assert other.locator("tr[aria-selected=false]").count() == 2
    other.locator("#all").click()
    assert other.locator("tr[aria-selected]").count() == 0
    other.close()


def test_a_label_isolates_its_tracker(asked_two, opened):
    _, path = write([asked_two], None, None)
    page, complaints, _ = opened(path)
    box = page.locator("#figure-cost canvas").bounding_box()
    for down in range(20, 400, 4):
        page.mouse.click(box["x"] + box["width"] - 25, box["y"] + down)
        state = page.evaluate("location.hash")
        if "tracker=" in state:
            break
    name = state.split("tracker=")[1]
    assert page.inner_text("#all") == f"Show all, not only {name}"
    chosen = page.locator("tr[aria-selected=true]").all_inner_texts()
    assert len(chosen) == 1
    assert chosen[0].startswith(name)
    page.evaluate("freepathReady()")
    assert complaints == []


def test_what_is_seen_can_be_saved(asked_two, opened):
    _, path = write([asked_two], None, None)
    page, complaints, _ = opened(path, accept_downloads=True)
    saved = {}
    for name, where in (("csv", "#csv"), ("svg", "text=SVG"), ("png", "text=PNG")):
        with page.expect_download() as download:
            page.locator(where).first.click()
        with open(download.value.path(), "rb") as file:
            saved[name] = file.read()
    first = next(csv.DictReader(saved["csv"].decode().splitlines()))
    assert (first["case"], float(first["to 1 %"])) == ("ratio, global x1", 0.004)
    assert b"<svg" in saved["svg"][:200]
    assert b"1000 %" in saved["svg"] and b"100 us" in saved["svg"]
    assert saved["png"].startswith(b"\x89PNG")
    assert complaints == []


def test_curves_leave_the_axis_and_seven_trackers_have_colours(tmp_path):
    """A bias of 15 times the mean is no plateau at 10; the eighth tracker is grey."""
    rows = [row_of(i, f"t{i}", seconds=1e-6 * (i + 1)) for i in range(9)]
    rows += [row_of(20, "off", bias="7.5", bias_rms="7.5", time_to_1pct_s="inf")]
    report = load([result_of(tmp_path / "nine", rows)])
    chart = picture(report, "cost").to_dict()
    (panel,) = chart["concat"]
    lines = next(one for one in panel["layer"] if one["mark"]["type"] == "line")
    assert lines["mark"]["clip"]
    assert "clamp" not in lines["encoding"]["y"]["scale"]
    scale = next(
        one["encoding"]["color"]["scale"] for one in panel["layer"] if one["mark"]["type"] == "text"
    )
    colours = dict(zip(scale["domain"], scale["range"], strict=True))
    assert len({colours[f"t{i}"] for i in range(7)}) == 7
    assert {colours["t7"], colours["t8"], colours["off"]} == {"#9a9ea6"}
    svg = tmp_path / "p.svg"
    write([tmp_path / "nine"], svg, None)
    drawn = svg.read_text()
    assert all(f">t{i}</text>" in drawn for i in range(7))
    assert ">t7</text>" not in drawn
    assert ">10 us</text>" in drawn


def test_pictures_at_equal_time_say_whether_it_was(work, selector, opened):
    (work / "x.yaml").write_text(
        "name: x\nrender: true\nrays: {orthographic: {resolution: [16, 8]}}\n"
        "matrix: {medium: {cloud: {resolution: 16, sigma_t: 8}}, tracker: [delta, ratio]}\n"
        "stop: {samples: 500}\n"
    )
    assert main(["run", "x.yaml", "-o", "out", "-d", selector]) == 0
    paths = sorted((work / "out" / pictures.EQUAL_TIME).glob("*.exr"))
    for times, told in (
        ((1e-5, 1.04e-5), "Each case had the same device time, within 5 %."),
        ((1e-5, 1.6e-5), "Device times differ: 10 us to 16 us a pixel, a factor of 1.6."),
    ):
        for path, seconds in zip(paths, times, strict=True):
            facts, parts = pictures.read_exr(path)
            facts = {name: text for name, text in facts.items() if name.startswith("freepath:")}
            facts |= {"freepath:time_s": str(seconds)}
            base = path.with_suffix("")
            pictures.write_exr(base, parts["mean"], parts["variance"], facts)
        write([work / "out"], None, None)
        page, complaints, _ = opened(work / "out" / "report.html")
        assert page.inner_text("#renders-hint").startswith(told)
    errors = page.locator("#renders figcaption").all_inner_texts()[1:]
    found = [float(text.split("RMSE ")[1].removesuffix(" %")) for text in errors]
    assert found == sorted(found)
    page.locator(".pair").nth(2).click()
    assert page.locator("#wipe").is_visible()
    edge = "getComputedStyle(document.querySelector('#over')).clipPath"
    assert page.evaluate(edge) == "inset(0px 50% 0px 0px)"
    page.locator("#edge").fill("20")
    assert page.evaluate(edge) == "inset(0px 80% 0px 0px)"
    assert page.locator("#under").get_attribute("src") != page.locator("#over").get_attribute("src")
    assert complaints == []


def test_a_page_of_a_run_that_goes_on_says_so(asked_two, opened):
    for ended, told in (
        ("running, or killed", "(running, or killed); 6 of 9 cases are here"),
        ("interrupted", "(interrupted); 6 of 9 cases are here"),
        ("complete", None),
    ):
        facts = {"sessions": [{"ended": "complete"}, {"ended": ended}], "cases": [{}] * 9}
        (asked_two / "run.json").write_text(json.dumps(facts))
        _, path = write([asked_two], None, None)
        page, _, _ = opened(path)
        found = page.locator("#unfinished")
        assert told in found.inner_text() if told else not found.count()


SLACK = 4
"""Other work on the machine that runs the tests is forgiven."""
FIRST = "document.querySelector('#figure-cost canvas') && document.querySelector('#body tr')"


@pytest.mark.slow
def test_ten_thousand_rows(work, selector, browser):
    """Built in 5 s, open in 2 s: the first chart is drawn, and the table can be used."""
    (work / "x.yaml").write_text(
        "name: x\nrays: {orthographic: {resolution: [4, 4]}}\nstop: {samples: 50}\n"
        "matrix: {medium: {homogeneous: {sigma_t: 1}}, tracker: [delta, ratio], "
        "tightness: [1, 2]}\n"
    )
    assert main(["run", "x.yaml", "-o", "out", "-d", selector]) == 0
    result = many(work / "out", work / "many")
    write([result], None, None)  # so that the library is there
    started = time.process_time()
    _, path = write([result], None, None)
    took = {"build": time.process_time() - started}
    page = browser.new_page()
    complaints = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri(), wait_until="commit")
    page.wait_for_function(FIRST)
    # by the browser's clock, from the start of the navigation on
    took["open"] = page.evaluate("performance.now()") / 1000

    def timed(name, action, until):
        before = page.evaluate("performance.now()")
        action()
        page.wait_for_function(until)
        took[name] = (page.evaluate("performance.now()") - before) / 1000

    header = page.locator("#head th", has_text="rel. var.")
    timed("sort", header.click, "document.querySelector('th[aria-sort=ascending]')")
    some = "document.querySelector('#place').textContent.endsWith('of 1')"
    asked = page.locator("#question option", has_text="homogeneous-1-3").get_attribute("value")
    page.select_option("#question", asked)
    timed("filter", lambda: page.fill("#filter", "ratio-p=7, x2"), some)
    page.close()
    print(", ".join(f"{name} {seconds:.2f} s" for name, seconds in took.items()))
    assert complaints == []
    assert took["build"] < 5 * SLACK / 2
    assert max(took["open"], took["sort"], took["filter"]) < 2 * SLACK
