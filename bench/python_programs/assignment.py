"""Assign jobs to vehicles by auction, round after round, until no vehicle bids less."""

from math import hypot
from random import Random


class Vehicle:
    speed = 8.0

    def __init__(self, name, x, y, battery):
        self.name, self.x, self.y, self.battery = name, x, y, battery
        self.jobs = []

    def tour(self, jobs):
        x, y, length = self.x, self.y, 0.0
        for job in jobs:
            length += hypot(job["from"][0] - x, job["from"][1] - y) + job["length"]
            x, y = job["to"]
        return length

    def bid(self, job):
        offers = []
        for place in range(len(self.jobs) + 1):
            tour = self.tour([*self.jobs[:place], job, *self.jobs[place:]])
            if tour / self.speed < self.battery:
                offers.append((tour - self.tour(self.jobs), place))
        return min(offers, default=None)


def assign(vehicles, jobs):
    refused = []
    for job in sorted(jobs, key=lambda job: (-job["priority"], job["name"])):
        bids = [(bid, vehicle.name, vehicle) for vehicle in vehicles if (bid := vehicle.bid(job)) is not None]
        if not bids:
            refused.append(job["name"])
            continue
        (_, place), _, winner = min(bids, key=lambda offer: offer[:2])
        winner.jobs.insert(place, job)
    return refused


def prepare(seed):
    random = Random(seed)
    jobs = []
    for number in range(30):
        start = random.uniform(-500, 500), random.uniform(-500, 500)
        end = random.uniform(-500, 500), random.uniform(-500, 500)
        length = hypot(end[0] - start[0], end[1] - start[1])
        jobs.append(
            {"name": f"job {number}", "from": start, "to": end, "length": length, "priority": number % 3}
        )
    return [(f"drone {n}", random.uniform(-500, 500), random.uniform(-500, 500)) for n in range(6)], jobs


def run(state):
    fleet, jobs = state
    vehicles = [Vehicle(name, x, y, 600.0) for name, x, y in fleet]
    refused = assign(vehicles, jobs)
    return len(refused), sum(vehicle.tour(vehicle.jobs) for vehicle in vehicles)
