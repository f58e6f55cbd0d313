"""Analyses of a model without a run: utilisation, response-time and latency bounds, memory, energy, battery.

Every result is a figure with the assumptions it rests on, or a refusal with its reason and the remedy. A
bound covers every release pattern that the model allows, a simulation only the one that it went through.
Imports of other packages start at ``volery.analysis.system_analysis``.
"""
