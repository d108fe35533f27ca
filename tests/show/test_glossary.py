"""The words of freepath: in the terminal and in docs/glossary.md they are the same."""

from pathlib import Path

import pytest

from freepath import cli
from freepath.show import glossary

PAGE = Path(__file__).parents[2] / "docs" / "glossary.md"


def test_the_page_is_what_the_terminal_says():
    assert PAGE.read_text("utf-8") == glossary.markdown()


def test_without_a_word_the_words_are_listed(capsys):
    assert cli.main(["explain"]) == 0
    assert capsys.readouterr().out.splitlines() == list(glossary.WORDS)


@pytest.mark.parametrize("words", [["tentative", "collision"], ["Tentative_Collision"]])
def test_a_word_is_explained(capsys, words):
    assert cli.main(["explain", *words]) == 0
    assert capsys.readouterr().out == glossary.WORDS["tentative collision"] + "\n"


def test_a_word_that_is_none_is_refused_with_a_guess(capsys):
    assert cli.main(["explain", "tighness"]) == 5
    error = capsys.readouterr().err
    assert "no word 'tighness' in the glossary; did you mean 'tightness'?" in error
