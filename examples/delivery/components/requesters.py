"""The people at the hospitals who order, at times and for places that a seeded stream draws."""

from __future__ import annotations

import random

import volery

GOODS = ("blood", "vaccine", "antidote", "sample kit")


class Requesters:
    """Part of the surroundings. ``orders`` is the service, ``city`` says where hospitals are and how much is
    ordered.
    """

    def __init__(self, orders, city):
        self._orders = orders
        self._workload = city.workload
        self._hospitals = [place.name for place in city.places_with("hospital")]
        self._draw = random.Random(f"{self._workload.stream} {random.getrandbits(64)}")

    def run(self):
        """Order, as often as the workload says."""
        volery.sleep(self._workload.first_ns / 1e9)
        placed = 0
        while self._workload.count is None or placed < self._workload.count:
            self._order(placed % max(1, self._workload.requesters))
            placed += 1
            if not self._workload.rate_hz:
                break
            volery.sleep(self._draw.expovariate(self._workload.rate_hz))

    def _order(self, requester):
        hospital = self._draw.choice(self._hospitals)
        good = self._draw.choice(GOODS)
        receipt = self._orders.order(good, hospital)
        volery.log(
            f"requester {requester + 1} at {hospital} orders {good}: {receipt.parcel or receipt.reason}"
        )
