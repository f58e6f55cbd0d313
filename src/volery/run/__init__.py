"""Joins it all: ``simulate``, ``fly``, ``connect`` and ``serve``; one shape, one result.

The only room that sees every other below it. It opens clocks, processors and networks, gives each room what
it asks for, ends a run in the right order and keeps its folder. It must not know how a run is shown: reports
are found by name.
"""
