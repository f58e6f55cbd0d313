"""The entry points ``simulate``, ``fly``, ``connect``, ``serve`` and ``bridge``, and the life of a run.

The only package that sees all packages below it. It opens clocks, processors and networks, connects the other
packages, ends a run in the right order and keeps its folder. It does not know how a run is shown: reports are
found by name. ``assembly`` creates the parts of a run, ``distributed`` runs components as processes on real
ROS.
"""
