"""The time of operations on this machine: the figures of its core, for the cost of compiled code."""
