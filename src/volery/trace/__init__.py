"""The event stream of a run: one schema, its writers and its reader.

Knows nobody: every room that has something to tell imports this one. It must not know what an event is for.
"""
