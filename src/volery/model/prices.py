"""Prices of hardware: an amount in a currency, with the year and the source that it is from."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from volery.model.fields import TEXT, Record, Schema, Shorter, Syntax, Whole, expected
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

_AMOUNT = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([A-Z]{3})\s*")


@dataclass(frozen=True, slots=True)
class Amount:
    """A sum of money. ``currency`` is a code of ISO 4217, such as ``USD``."""

    value: float
    currency: str

    def __str__(self) -> str:
        """Return it as a model states it."""
        return f"{self.value:g} {self.currency}"


def parse_amount(text: str) -> Amount | None:
    """Return the amount of a text such as ``55 USD``; None if it is none."""
    match = _AMOUNT.fullmatch(text)
    return Amount(float(match.group(1)), match.group(2)) if match else None


class _Amount(Syntax):
    """An amount with its currency."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Amount:
        """See ``Syntax``."""
        amount = parse_amount(node.value) if isinstance(node.value, str) else None
        if amount is None:
            raise expected("an amount with its currency, such as 55 USD or 1200 EUR,", node)
        return amount

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string", "x-quantity": "an amount with its currency, such as 55 USD"}


@dataclass(frozen=True, slots=True)
class StatedPrice:
    """A price. Written as its amount alone, or as a mapping."""

    amount: Annotated[Amount, _Amount(), "Amount and currency."]
    year: Annotated[int | None, Whole(least=1990, most=2100), "Year of the price."] = None
    source: Annotated[str, TEXT, "Who asks it; for an estimate, its basis."] = ""


PRICE = Shorter(Record(StatedPrice), key="amount")
