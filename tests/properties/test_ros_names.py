import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.ros.graph.interface import absolute_name, absolute_remaps, check_name, full_node_name

TOKENS = st.from_regex(r"[A-Za-z][A-Za-z0-9]{0,8}", fullmatch=True)
RELATIVE = st.lists(TOKENS, min_size=1, max_size=4).map("/".join)
NAMESPACES = st.one_of(st.just("/"), RELATIVE.map(lambda name: f"/{name}"))


@given(RELATIVE, NAMESPACES, TOKENS)
def test_an_absolute_name_stays_what_it_is(name: str, namespace: str, node: str) -> None:
    full = full_node_name(node, namespace)
    assert absolute_name(f"/{name}", namespace, full) == f"/{name}"


@given(RELATIVE, NAMESPACES, TOKENS)
def test_relative_and_private_names_become_absolute_once(name: str, namespace: str, node: str) -> None:
    full = full_node_name(node, namespace)
    relative = absolute_name(name, namespace, full)
    private = absolute_name(f"~{name}", namespace, full)
    assert relative == f"{namespace.rstrip('/')}/{name}"
    assert private == f"{full}/{name}"
    for resolved in (relative, private):
        assert absolute_name(resolved, "/elsewhere", "/elsewhere/other") == resolved


@given(st.text(max_size=12))
def test_any_text_is_a_valid_name_or_refused(text: str) -> None:
    try:
        check_name(text)
    except UsageError as error:
        refusal = str(error)
    else:
        refusal = ""
    if refusal:
        assert refusal.startswith(repr(text))
        return
    resolved = absolute_name(text, "/ns", "/ns/node")
    assert resolved.startswith("/")
    assert "//" not in resolved
    assert not resolved.endswith("/")


@given(st.dictionaries(RELATIVE, RELATIVE, max_size=4), NAMESPACES)
def test_remapping_is_the_same_for_both_spellings(remaps: dict[str, str], namespace: str) -> None:
    full = full_node_name("node", namespace)
    table = absolute_remaps(remaps, namespace, full)
    for old, new in remaps.items():
        assert table[absolute_name(old, namespace, full)] == absolute_name(new, namespace, full)


@pytest.mark.parametrize("name", ["a", "/a", "~a", "~/a", "a/b_c", "/a/b1", "_hidden"])
def test_valid_names(name: str) -> None:
    check_name(name)
