"""The tree of a model's text: lines, paths, copies, and what is no model."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import Location, ModelError
from volery.model import rules
from volery.model import text as model_text
from volery.model.text import (
    CollectedModelError,
    Problems,
    Quoted,
    TextNode,
    is_inside,
    no_such,
    outside,
    parse,
    parse_value,
    stated_texts,
    written,
)

TEXT = """\
name: five
list:
  - one
  - {two: "2", three: 3}
flow: [a, 1.5, true, null, 'no']

deep:
  er:
    est: end
"""


@pytest.fixture
def tree() -> TextNode:
    return parse(TEXT, "m.yaml")


def refusal(text: str) -> ModelError:
    with pytest.raises(ModelError) as caught:
        parse(text, "m.yaml")
    return caught.value


def problems_at(lines: dict[tuple[str | int, ...], int]) -> Problems:
    return Problems(lambda path: Location("m.yaml", lines[path]) if path in lines else None)


def test_values_have_the_types_of_yaml_1_2(tree: TextNode) -> None:
    assert tree.plain() == {
        "name": "five",
        "list": ["one", {"two": "2", "three": 3}],
        "flow": ["a", 1.5, True, None, "no"],
        "deep": {"er": {"est": "end"}},
    }
    assert parse("a: yes", "m").plain() == {"a": "yes"}


def test_a_text_in_quotation_marks_stays_one(tree: TextNode) -> None:
    plain = tree.plain()
    assert isinstance(plain["list"][1]["two"], Quoted)
    assert isinstance(plain["flow"][4], Quoted)
    assert not isinstance(plain["name"], Quoted)
    assert isinstance(tree.copy().plain()["flow"][4], Quoted)
    assert isinstance(tree.moved(Location("x", 9)).plain()["flow"][4], Quoted)


def test_an_entry_stands_in_the_line_of_its_key_and_an_item_in_its_own(tree: TextNode) -> None:
    lines = {
        (): 1,
        ("name",): 1,
        ("list",): 2,
        ("list", 0): 3,
        ("list", 1): 4,
        ("list", 1, "three"): 4,
        ("flow", 2): 5,
        ("deep",): 7,
        ("deep", "er"): 8,
        ("deep", "er", "est"): 9,
    }
    assert {path: tree.locate(path) for path in lines} == {
        path: Location("m.yaml", line) for path, line in lines.items()
    }


def test_a_path_that_does_not_exist_is_located_at_its_deepest_part_that_does(tree: TextNode) -> None:
    assert tree.locate(("deep", "er", "nothing", "here")) == Location("m.yaml", 8)
    assert tree.at(("deep", "er", "nothing", "here")) is None
    found = tree.at(("deep", "er", "est"))
    assert found is not None
    assert found.value == "end"


def test_items_are_found_by_number_and_by_its_text_up_to_the_last(tree: TextNode) -> None:
    listed = tree.child("list")
    assert listed is not None
    first, last = listed.child("0"), listed.child(1)
    assert first is not None
    assert last is not None
    assert first.value == "one"
    assert set(last.items) == {"two", "three"}
    assert listed.child(2) is None
    assert listed.child("two") is None
    assert listed.items == {}


def test_a_copy_is_deep_and_keeps_lines_and_a_moved_one_has_new_ones(tree: TextNode) -> None:
    copy = tree.copy()
    moved = tree.moved(Location("other.yaml", 77))
    tree.items["deep"].items["er"].items.clear()
    path = ("deep", "er", "est")
    assert copy.plain()["deep"] == {"er": {"est": "end"}} == moved.plain()["deep"]
    assert copy.locate(path) == Location("m.yaml", 9)
    for below in ((), ("list",), ("list", 1), path):
        assert moved.locate(below) == Location("other.yaml", 77)


def test_texts_of_a_key_are_one_or_a_list_of_them(tree: TextNode) -> None:
    assert stated_texts(tree, "name") == ["five"]
    assert stated_texts(tree, "flow") == ["a", "no"]
    assert stated_texts(tree, "deep") == []
    assert stated_texts(tree, "nowhere") == []


@pytest.mark.parametrize(
    ("text", "line", "path", "says", "code"),
    [
        ("", 1, "", "the file is empty; `volery new DIR`", rules.NOT_A_MODEL),
        ("\x07", 1, "", "this is not YAML", rules.NOT_A_MODEL),
        ("a: 1\nb: [1, 2\nc: 3\n", 3, "", "this is not YAML: while parsing a flow", rules.NOT_A_MODEL),
        ("a: 1\n? [x]\n: 2\n", 2, "", "a key must be a word", rules.NOT_A_MODEL),
        ("a: &x {b: 1}\nc:\n  <<: *x\n", 3, "c", "merge keys (<<) are not read", rules.NOT_A_MODEL),
        (
            "a:\n  b: 1\n  c: 2\n  b: 3\n",
            4,
            "a.b",
            "this key is here twice; first in line 2",
            rules.DUPLICATE_KEY,
        ),
        ("a: 1\nb: &x [*x]\n", 2, "b.0", "an alias that contains itself", rules.TOO_LARGE),
        ("a: 1\nb: !!int x\n", 2, "b", "'x' is no number", rules.NOT_A_MODEL),
        ("[" * 600, 1, "", "nested too deeply", rules.NOT_A_MODEL),
        (
            "a: 1\nb: " + "1" * 101,
            2,
            "b",
            "a number of 101 characters; at most 100 are read",
            rules.NOT_A_MODEL,
        ),
    ],
)
def test_what_is_no_model(text: str, line: int, path: str, says: str, code: rules.ModelRule) -> None:
    error = refusal(text)
    assert says in error.what
    assert (error.where, error.path, error.code) == (Location("m.yaml", line), path, code.code)


def test_the_longest_number_is_read() -> None:
    assert parse("a: " + "1" * 100, "m").plain() == {"a": int("1" * 100)}


def test_nested_aliases_are_counted_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_text, "MOST_NODES", 1000)
    wide = "a: &a [" + "1, " * 300 + "1]\n"
    copies, rest = divmod(1000 - 304, 302)  # the top, both lists, and 301 numbers of the first
    full = wide + "b: [" + "*a, " * copies + "1, " * (rest - 1)
    assert len(parse(full + "1]\n", "m").plain()["b"]) == copies + rest
    error = refusal(full + "1, 1]\n")
    assert error.what == "more than 1000 values; is it a model?"
    assert (error.path, error.where) == (f"b.{copies + rest}", Location("m.yaml", 2))


def test_brackets_of_a_type_within_braces_have_a_hint() -> None:
    error = refusal("a: 1\nb: {takes: Order[], x: 1}\n")
    assert 'put quotes around "Type[]"' in error.what
    assert "quotes" not in refusal("a: 1\nb: {takes: Order], x: 1}\n").what


def test_an_options_value_stands_where_the_option_is() -> None:
    where = Location("--set a=b", 0)
    assert parse_value("  ", where) == TextNode(None, where)
    value = parse_value("{x: [1, 2]}", where)
    assert value.plain() == {"x": [1, 2]}
    assert value.locate(("x", 1)) == where
    with pytest.raises(ModelError, match="'\\[1': this is not YAML") as caught:
        parse_value("[1", where)
    assert caught.value.where == where


# -- problems


def test_one_problem_is_raised_as_it_is_and_several_in_the_order_of_the_file() -> None:
    found = problems_at({("b",): 12, ("a",): 3})
    found.raise_if_any()
    assert not found
    found.add(("b",), "late")
    found.add(("b",), "late")
    assert found
    with pytest.raises(ModelError) as one:
        found.raise_if_any()
    assert not isinstance(one.value, CollectedModelError)
    found.add(("a",), "early")
    found.add(("c",), "nowhere")
    found.add(("d",), "elsewhere", Location("m.yaml", 5))
    with pytest.raises(CollectedModelError, match=r"^4 things are wrong with this model:\n") as several:
        found.raise_if_any()
    assert [error.what for error in several.value.errors] == ["nowhere", "early", "elsewhere", "late"]


def test_a_collection_of_problems_passes_between_processes() -> None:
    errors = [ModelError("one", "a.b", Location("m.yaml", 1)), ModelError("two", "c")]
    copy: Any = pickle.loads(pickle.dumps(CollectedModelError(errors)))
    assert [str(error) for error in copy.errors] == [str(error) for error in errors]
    assert str(copy).count("\n") == 2


def test_problems_of_a_copy_are_those_of_its_origin_until_it_is_replaced() -> None:
    found = problems_at({("from", "x"): 4, ("to", "x"): 9})
    found.copied(("to",), ("from",))
    found.add(("to", "x"), "wrong")
    found.copied(("to",), None)
    found.add(("to", "x"), "wrong, too")
    with pytest.raises(CollectedModelError) as caught:
        found.raise_if_any()
    rows = [(error.path, error.where) for error in caught.value.errors]
    assert rows == [("from.x", Location("m.yaml", 4)), ("to.x", Location("m.yaml", 9))]


def test_a_warning_is_kept_once_and_is_no_problem() -> None:
    found = problems_at({("a", 1): 6})
    for _ in range(2):
        found.warn(("a", 1), "doubtful", rules.WRONG_VALUE)
    assert [(one.what, one.path, one.where) for one in found.warnings] == [
        ("doubtful", "a.1", Location("m.yaml", 6))
    ]
    assert not found
    assert found.where(("a", 1)) == Location("m.yaml", 6)


def test_an_unknown_name_lists_the_known_ones() -> None:
    found = problems_at({})
    found.unknown(("a",), "drne", "vehicle", iter(["drone", "rover"]))
    with pytest.raises(ModelError) as caught:
        found.raise_if_any()
    assert caught.value.code == rules.UNKNOWN_NAME.code
    assert caught.value.what == no_such("drne", "vehicle", ["drone", "rover"])
    assert "'drne' (did you mean 'drone'?); there is drone or rover" in caught.value.what
    assert written(("a", 1, "b")) == "a.1.b"


def test_files_outside_of_the_models_folders_are_refused(tmp_path: Path) -> None:
    inside, elsewhere = tmp_path / "model", tmp_path / "other"
    for folder in (inside, elsewhere):
        folder.mkdir()
    (elsewhere / "secret.py").write_text("")
    (inside / "link.py").symlink_to(elsewhere / "secret.py")
    assert is_inside(inside / "own.py", [inside])
    assert not is_inside(inside / "link.py", [inside])
    (inside / "loop.py").symlink_to("loop.py")
    assert is_inside(inside / "loop.py", [inside])
    assert is_inside(inside / "link.py", [inside, elsewhere])
    assert not is_inside(inside / ".." / "other" / "secret.py", [inside])
    assert outside("link.py").startswith(
        "'link.py' is outside the folder of the model; list its folder under"
    )


def test_problems_of_no_line_come_first_and_those_of_one_line_in_the_order_found() -> None:
    found = problems_at({("b",): 1, ("a",): 1})
    for name in ("b", "a"):
        found.add((name,), f"{name} is wrong")
    found.add(("c",), "no place")
    with pytest.raises(CollectedModelError) as caught:
        found.raise_if_any()
    assert [error.what for error in caught.value.errors] == ["no place", "b is wrong", "a is wrong"]


def test_a_fault_behind_the_last_line_has_its_number() -> None:
    error = refusal("a: [1,\n2,")
    assert error.where == Location("m.yaml", 2)
    assert refusal("a: [1,\n2,\n").where == Location("m.yaml", 3)
