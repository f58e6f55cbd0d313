"""Sensors that a model adds to a vehicle: what they measure in the world, as numbers for messages.

A ``Sensor`` of ``volery.simulation.world.sensors`` each, as packages add them, too. Those that range cast all
rays of a sample in one compiled call.
"""
