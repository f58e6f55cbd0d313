"""From a model or from addresses to the parts of a run: computers, components, vehicles, graphs, faults.

Nothing here starts a clock or decides when a run ends; the entry points above do.
"""
