"""Draw the packages of volery on their layers, with their dependencies, from the imports."""

from __future__ import annotations

import tomllib
from pathlib import Path

import grimp
import networkx as nx

ROOT = Path(__file__).parent.parent
WIDTH, ROW, BOX, HEIGHT = 960, 84, 150, 38
COLUMNS = {
    "cli": 2.3, "report": 0.3, "analysis": 1.0, "deploy": 1.65, "drawing": 2.95, "calibration": 2.3,
    "checks": 2.95, "explore": 1.0, "testing": 3.6, "run": 2.3, "components": 1.7, "bridge": 2.9,
    "control": 0.6, "autonomy": 1.1, "vehicles": 2.3, "simulation": 3.6, "links": 3.0, "ros": 2.6,
    "kernel": 2.6,
    "requirements": 0.45, "exchange": 1.2, "model": 0.9, "cost": 1.75, "trace": 2.6, "base": 1.75,
}  # fmt: skip
"""Horizontal places, 0 to 4, chosen so that arrows pass between the boxes. A new package needs one."""


def layers() -> list[list[str]]:
    """Return the packages of each layer, the highest layer first, from the contract in pyproject.toml."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    ordered = next(each for each in contracts if each["containers"] == ["volery"])["layers"]
    return [[name.strip() for name in names.split("|")] for names in ordered]


def dependencies() -> nx.DiGraph[str]:
    """Return which package imports which, without the imports that follow from others."""
    graph = grimp.build_graph("volery", cache_dir=None)
    packages: nx.DiGraph[str] = nx.DiGraph()
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            one, two = (each.split(".")[1] if "." in each else "" for each in (module, other))
            if one and two and one != two:
                packages.add_edge(one, two)
    return nx.transitive_reduction(packages)


def package_map() -> str:
    """Return the map as SVG: one row per layer, an arrow from each package to those that it imports."""
    rows = layers()
    place = {
        name: (WIDTH * (COLUMNS[name] + 0.1) / 4.1, ROW * (number + 0.5))
        for number, row in enumerate(rows)
        for name in row
    }
    height = ROW * len(rows)
    size = f'viewBox="0 0 {WIDTH} {height}"'
    drawn = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="16">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 8 4 0 8z" fill="#5b7083"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
    ]
    for one, two in sorted(dependencies().edges):
        if one in place and two in place:
            (x1, y1), (x2, y2) = place[one], place[two]
            top, bottom = y1 + HEIGHT / 2, y2 - HEIGHT / 2
            bend = (bottom - top) * 0.45
            curve = f"C{x1:.0f} {top + bend:.0f} {x2:.0f} {bottom - bend:.0f} {x2:.0f} {bottom:.0f}"
            drawn.append(
                f'<path d="M{x1:.0f} {top:.0f} {curve}" fill="none" stroke="#5b7083" stroke-opacity=".6" '
                'marker-end="url(#tip)"/>'
            )
    for name, (x, y) in place.items():
        drawn.append(
            f'<rect x="{x - BOX / 2:.0f}" y="{y - HEIGHT / 2:.0f}" width="{BOX}" height="{HEIGHT}" rx="6" '
            f'fill="#eef4f8" stroke="#33516b"/><text x="{x:.0f}" y="{y + 5:.0f}" text-anchor="middle" '
            f'fill="#1d3246">{name}</text>'
        )
    return "\n".join([*drawn, "</svg>", ""])
