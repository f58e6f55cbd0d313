"""Mapping, marker detection and route planning. Not there yet."""
