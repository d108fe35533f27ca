"""What goes into a paper: charts of a given width, tables of LaTeX, and BibTeX."""

import re
import struct

import pytest

from freepath.cli import main
from freepath.compose import catalog
from freepath.show.citations import references
from freepath.show.report import Choice, load
from freepath.show.report.pictures import as_wide, converted
from freepath.show.report.text import latex, latex_of, sentences
from support.rows import EVIL, result_of, row_of

CM = 72 / 2.54


@pytest.fixture
def result(tmp_path):
    rows = [row_of(i, name, seconds=1e-6 * i) for i, name in enumerate(("ratio", "delta"), 1)]
    rows += [row_of(3, "march", medium="50%_fog & more")]
    return result_of(tmp_path / "out", rows)


def test_a_picture_has_the_width_that_is_asked_for(result):
    """In a PDF by its page, in an SVG by its size, in a PNG by its pixels at 300 dpi."""
    report = load([result], question="cloud-64")
    sized = as_wide(report, Choice(width_pt=8.5 * CM, titled=False))
    svg, pdf, png = (converted(sized, kind, sized=True) for kind in ("svg", "pdf", "png"))
    box = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
    assert float(box[1]) == pytest.approx(8.5 * CM, abs=0.01)
    assert float(re.search(rb'width="([\d.]+)pt"', svg)[1]) == pytest.approx(8.5 * CM, abs=0.01)
    wide = float(re.search(rb'viewBox="0 0 ([\d.]+) ', svg)[1])
    assert wide == pytest.approx(8.5 * CM, abs=2)  # so that letters have the size that is theirs
    (pixels,) = struct.unpack(">I", png[16:20])
    assert pixels == pytest.approx(8.5 / 2.54 * 300, abs=1)
    assert not any(title in svg for title in (b"transmittance, cloud-64", b"What accuracy costs"))
    assert b"device time per ray" in svg


def test_only_what_is_asked_for_is_shown(result, capsys):
    found = load([result], only="ratio|march", question="fog")
    assert [row["tracker"] for row in found.rows] == ["march"]
    asked = ["report", str(result), "-o", str(result / "b.svg"), "--question", "cloud-64"]
    assert main(asked) == 0
    svg = (result / "b.svg").read_text()
    assert "transmittance, cloud-64" in svg and "fog" not in svg
    assert main(["report", str(result), "--format", "md", "--only", "nothing"]) == 5
    assert "no case of" in (told := capsys.readouterr().err) and "matches 'nothing'" in told
    narrow = ["report", str(result), "-o", str(result / "n.pdf"), "--width", "20mm"]
    assert main(narrow) == 2
    assert re.search(r"--width: the chart 'cost' needs [\d.]+ cm at least", capsys.readouterr().err)
    with pytest.raises(SystemExit):
        main([*narrow[:-1], "4m"])
    assert "expected a width such as 8.5cm" in capsys.readouterr().err


def test_tables_of_latex(result):
    """Every row has the cells that the columns are for, and nothing that LaTeX would read."""
    found = load([result])
    text = latex(found)
    tables = text.split(r"\begin{table}")[1:]
    assert len(tables) == 2
    for table, sentence in zip(tables, sentences(found), strict=True):
        columns = re.search(r"\\begin\{tabular\}\{([lr]+)\}", table)[1]
        top, middle, bottom = (table.index(rf"\{rule}rule") for rule in ("top", "mid", "bottom"))
        rows = table[top:middle].splitlines()[1:] + table[middle:bottom].splitlines()[1:]
        for row in rows:
            assert row.endswith(r" \\")
            assert len(re.findall(r"(?<!\\)&", row)) == len(columns) - 1
        assert latex_of(sentence.split(": ", 1)[1]) in table
        plain = re.sub(r"\\[a-z]+(\{[a-z]*\})?|\\.|\$\\[a-z]+\$", "", table)
        assert not re.search(r"[%#_^~\\$]", plain)
        assert table.count("{") - table.count(r"\{") == table.count("}") - table.count(r"\}")
    assert tables[0].index("ratio, global x1 &") < tables[0].index("delta, global x1 &")
    assert r"10\,ms" in tables[0] and r"1\,$\mu$s" in tables[0]
    assert r"50\%\_fog \& more" in tables[1]
    assert latex_of(EVIL) == (
        r"\textless{}/script\textgreater{}\textless{}script\textgreater{}alert(1)\textless{}/script"
        r"\textgreater{}\textless{}b\textgreater{}`\textbar{}"
    )


def test_citations_of_the_trackers_are_bibtex(tmp_path, capsys):
    names = ("split", "ratio", "residual_ratio", "lookup_only", "mine")
    rows = [row_of(i, name) for i, name in enumerate(names)]
    folder = result_of(tmp_path / "out", rows)
    assert main(["report", str(folder), "--format", "bibtex"]) == 0
    text = capsys.readouterr().out
    keys = re.findall(r"^@misc\{(\w+),$", text, re.MULTILINE)
    assert keys == ["eymet2013collision", "szirmaykalos2017unbiased", "novak2014residual"]
    assert "author = {Eymet and Poitou and Galtier and {El Hafi} and Terree and Fournier}" in text
    assert "% ratio, residual_ratio\n@misc{novak2014residual," in text
    assert "% split (the double particle model)\n@misc{szirmay" in text
    assert "% lookup_only: no paper; a yardstick" in text
    assert "% mine: is no shipped tracker" in text


def test_every_shipped_citation_can_be_read():
    """Each part of one that has a year is a work with authors; all but one have titles."""
    untitled = set()
    for tracker in catalog.load().trackers.values():
        found = references(tracker.citation)
        assert len(found) == len(re.findall(r"\b(?:19|20)\d\d\b", tracker.citation)), tracker.name
        assert len({one.key for one in found}) == len(found)
        untitled |= {one.key for one in found if not one.title}
    assert untitled == {"sutton1999"}
