"""What is printed: no control characters of others, and no endless errors."""

from __future__ import annotations

import pytest

from volery.cli.console import LONGEST_ERROR, CommandOutput, make_table, printable

EVIL = "\x1b]0;PWN\x07\x1b[2J\x9b2J\x7f\u202e name"


def test_no_control_character_of_a_name_reaches_the_terminal(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    output = CommandOutput()
    table = make_table("name")
    table.add_row(EVIL)
    output.show(EVIL, table)
    output.note(EVIL)
    output.complain(EVIL)
    CommandOutput(json=True).give(EVIL)
    written = capfd.readouterr()
    assert "\x1b[31m" in written.err, "the colours of volery itself are kept"
    for text in written:
        assert "name" in text
        for control in ("\x1b]", "\x1b[2J", "\x07", "\x9b", "\x7f", "\u202e"):
            assert control not in text
    assert "\\x1b]0;PWN" in written.out


def test_no_text_of_others_is_markup_or_an_emoji(capfd: pytest.CaptureFixture[str]) -> None:
    text = "model.yaml:100: no 'garag' [bold]here[/bold] :warning: [/]"
    output = CommandOutput()
    table = make_table("name", title=text)
    table.add_row(text)
    output.show(text, table)
    output.note(text)
    output.complain(text)
    CommandOutput(json=True).give(text)
    written = capfd.readouterr()
    assert written.out.count(text) == 4
    assert written.err.count(text) == 2


def test_lines_and_tabs_stay() -> None:
    assert printable("a\n\tb ö \u2028") == "a\n\tb ö \u2028"


def test_a_very_long_error_is_cut(capfd: pytest.CaptureFixture[str]) -> None:
    CommandOutput().complain("volery: " + "9" * 1_000_000)
    assert len(capfd.readouterr().err) < LONGEST_ERROR + 100
