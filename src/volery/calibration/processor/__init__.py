"""Figures of the core of this machine, for the cost of compiled code: times of single operations."""
