"""Faces: the embedded graph in the shape of a client library, so that a user's file runs unmodified.

Knows the graph, messages and the kernel's waiting. It must not know models, costs or vehicles, nor load
files: it gives module objects, and whoever loads a file puts them in the place of the real ones.
"""
