"""Orders and stock: dataclasses, dicts, exceptions, sorting by a key, text."""

from dataclasses import dataclass, field
from random import Random


class OutOfStockError(Exception):
    pass


@dataclass
class Order:
    number: int
    good: str
    amount: int
    urgent: bool = False
    history: list = field(default_factory=list)

    def note(self, state):
        self.history.append(f"{self.number:03d} {state}")


@dataclass(frozen=True)
class Place:
    x: float
    y: float

    def to(self, other):
        return abs(self.x - other.x) + abs(self.y - other.y)


class Store:
    def __init__(self, place, stock):
        self.place = place
        self.stock = dict(stock)

    def take(self, good, amount):
        left = self.stock.get(good, 0) - amount
        if left < 0:
            raise OutOfStockError(good)
        self.stock[good] = left


def serve(stores, order, where):
    for store in sorted(stores, key=lambda store: store.place.to(where)):
        try:
            store.take(order.good, order.amount)
        except OutOfStockError:
            order.note("not here")
            continue
        order.note("taken")
        return store
    order.note("refused")
    return None


def prepare(seed):
    random = Random(seed)
    goods = ["blood", "vaccine", "antidote", "kit"]
    stores = [
        (random.random(), random.random(), {good: random.randrange(40) for good in goods}) for _ in range(4)
    ]
    wanted = [(random.choice(goods), random.randrange(1, 5), random.random() < 0.2) for _ in range(120)]
    return stores, wanted


def run(state):
    stores = [Store(Place(x, y), stock) for x, y, stock in state[0]]
    orders = [Order(number, *wanted) for number, wanted in enumerate(state[1])]
    orders.sort(key=lambda order: (not order.urgent, order.number))
    served = [serve(stores, order, Place(order.number % 7 / 7, 0.5)) for order in orders]
    text = ",".join(line for order in orders for line in order.history)
    return sum(store is not None for store in served), len(text)
