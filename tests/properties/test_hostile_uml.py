"""Damaged UML files: whatever is removed, doubled or changed, an import reads or refuses, and never fails."""

import copy
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from volery.base.errors import ModelError
from volery.cli.commands.first_steps import example
from volery.exchange.uml.uml_model import export_uml, import_uml
from volery.model.assembly import read_tree

HAND_MADE = Path(__file__).parents[1] / "unit" / "exchange" / "uml" / "models"
FILES = [path.read_bytes() for path in sorted(HAND_MADE.glob("*.uml"))]
FILES.append(export_uml(read_tree(example("starter") / "model.yaml").plain(), "m.uml")[0].encode())
TEXTS = (
    "",
    "null",
    "-1",
    "x y",
    "1e999",
    "{[",
    "[]",
    "{is: x}",
    "$language=;",
    "(value=,unit=)",
    "BOET/MOET = 1/2/3;",
)

damage = st.tuples(
    st.sampled_from(["remove", "attribute", "refer", "text", "value", "double"]), st.integers(0)
)


def spoil(root, kind, number):
    elements = list(root.iter(etree.Element))
    one, other = elements[number % len(elements)], elements[number // 7 % len(elements)]
    names = list(one.attrib)
    if kind == "remove" and one is not root:
        one.getparent().remove(one)
    elif kind == "text":
        one.text = TEXTS[number % len(TEXTS)]
    elif kind == "double" and one is not root:
        other.append(copy.deepcopy(one))
    elif names and kind == "attribute":
        del one.attrib[names[number % len(names)]]
    elif names and kind == "value":
        one.set(names[number % len(names)], TEXTS[number % len(TEXTS)])
    elif names and kind == "refer" and other.attrib:
        one.set(names[number % len(names)], next(iter(other.attrib.values())))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, len(FILES) - 1), st.lists(damage, min_size=1, max_size=6))
def test_a_damaged_file_is_read_or_refused(file, damages):
    root = etree.fromstring(FILES[file])
    for kind, number in damages:
        spoil(root, kind, number)
    try:
        imported = import_uml(etree.tostring(root), "damaged.uml")
    except ModelError:
        return
    text, _ = export_uml(imported.tree, "damaged.uml", base=imported)
    again = import_uml(text.encode(), "damaged.uml")
    assert again.tree.keys() >= {"volery", "name"}
