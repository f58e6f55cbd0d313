"""The ground everything stands on: time, places on the globe, frames, units, errors, seeds, names.

This room imports no other room and no clock; it holds values and pure functions only.
"""
