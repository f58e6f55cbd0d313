"""XML of other people: parsed without entities, document types and the network."""

from __future__ import annotations

import re
from typing import Any, TypeAlias

from lxml import etree

from volery.base.errors import Location, ModelError

MOST_BYTES = 32 << 20
"""Largest file that is read. The complete profile of S3D with its history has 2.6 MB."""

Element: TypeAlias = Any
"""An element of lxml, which carries no types."""


def xml_root(data: bytes, name: str, *, keep_blanks: bool = False) -> Element:
    """Return the root of an XML text. *name* is the name of the file in messages.

    Raises:
        ModelError: it is no XML, is too large, or declares a document type or an entity.
    """
    if len(data) > MOST_BYTES:
        what = f"{len(data) / 1e6:.0f} MB; at most {MOST_BYTES >> 20} MiB are read"
        raise ModelError(what, "", Location(name, 0))
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", data[: 1 << 16], re.IGNORECASE) or b"<!ENTITY" in data:
        what = "a document type or an entity is declared; it is not read: remove the declaration"
        raise ModelError(what, "", Location(name, 1))
    parser = etree.XMLParser(
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=False,
        remove_blank_text=not keep_blanks,
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        line = error.lineno or 1
        raise ModelError(f"this is not XML: {error.msg}", "", Location(name, line)) from None
    if root.getroottree().docinfo.doctype:  # in an encoding in which the search above finds nothing
        raise ModelError("a document type is declared; models have none", "", Location(name, 1))
    return root
