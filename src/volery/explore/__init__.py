"""Campaigns and design-space exploration. Not there yet."""
