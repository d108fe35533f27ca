"""What names hold commands no terminal, no spreadsheet, no page and no Markdown."""

import csv
import io

import pytest
from tests.results.test_results import row_of

from freepath import cli
from freepath.checks.outcome import Outcome
from freepath.commands.common import console_of
from freepath.extras import candidate
from freepath.results.columns import COLUMNS
from freepath.results.folder import ResultFolder, texts
from freepath.show import listing, markdown
from freepath.show.compare import showing
from freepath.show.compare.judging import Judged
from freepath.show.report import page

RED = "\x1b[31mred\x9b31m\u202e"
PLAIN = "?[31mred?31m?"


def test_messages_command_no_terminal(capsys):
    assert cli.main(["report", RED]) == 2
    assert f"freepath: {PLAIN}: expected the folder of a run" in capsys.readouterr().err
    console = console_of()
    console.print(listing.table_of([{"title": RED, "needs": f"{RED}, x"}]))
    console.print(RED, markup=False)
    told = capsys.readouterr().out
    assert told.count(PLAIN) == 3
    assert "\x1b" not in told


def test_rows_command_no_terminal_and_no_spreadsheet(tmp_path):
    """What a compiler says, with its colours, is written so that it can be read again."""
    row = row_of(reason=f"{RED}\nerror", device="=cmd|' /C calc'!A0", estimate=-0.5)
    cells = texts(row, COLUMNS)
    assert cells["reason"] == f"{PLAIN}\nerror"
    assert cells["device"] == "'=cmd|' /C calc'!A0"
    assert cells["estimate"] == "-0.5"
    assert texts(cells, COLUMNS) == cells
    folder = ResultFolder(tmp_path / "out")
    folder.open([])
    folder.append(row | {"status": "build_failed"})
    folder.close()
    assert folder.rows()[0]["reason"] == cells["reason"]
    assert folder.rows()[0]["device"] == row["device"]


@pytest.mark.parametrize("name", ["=cmd", "+1", "-x", "@sum", "\tx"])
def test_a_comparison_commands_no_spreadsheet(name):
    one = Judged(key=("a",), row={"case": "transmittance/m", "device": name}, verdict="SAME")
    ((_, *cells),) = [list(csv.reader(io.StringIO(showing.as_csv([name], [[one]]))))]
    assert dict(zip(("contender", *showing.COLUMNS), cells[0], strict=True))["device"] == f"'{name}"
    assert cells[0][0] == f"'{name}"


def test_names_are_texts_in_markdown():
    assert markdown.text_of("# <b>*x* [y](z) `c`|\nnew") == (
        "\\# \\<b\\>\\*x\\* \\[y\\](z) \\`c\\`\\| new"
    )
    assert markdown.text_of(RED) == f"{PLAIN[:1]}\\[31mred?31m?"


def test_the_script_of_the_page_is_sealed(tmp_path, monkeypatch):
    vl_convert = pytest.importorskip("vl_convert")
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path))
    monkeypatch.setattr(vl_convert, "javascript_bundle", lambda: "good </script>")
    assert page._library() == "good <\\/script>"
    monkeypatch.setattr(vl_convert, "javascript_bundle", lambda: "better")
    assert page._library() == "good <\\/script>"
    (kept,) = tmp_path.iterdir()
    kept.write_bytes(kept.read_bytes().replace(b"good", b"evil"))
    assert page._library() == "better"
    kept.write_text("evil")
    assert page._library() == "better"


def test_what_try_keeps_follows_no_link(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    (tmp_path / "checks.json").symlink_to(victim)
    candidate.keep([Outcome(1, "a", (), "passed", 0.1)], tmp_path)
    assert victim.read_text() == "mine"
    assert not (tmp_path / "checks.json").is_symlink()
