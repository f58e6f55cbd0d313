"""What a vehicle knows of its surroundings and where it goes in them: pure functions of arrays and messages.

Nothing here knows a kernel, a vehicle or a graph: components of a model call it, and so does ``volery map``.
"""
