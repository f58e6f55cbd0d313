"""Diagrams of a model: functional architecture, deployment, verification environment and topics.

``views`` makes boxes and links of a model, ``layers`` places them, ``shapes`` draws SVG, ``mermaid`` writes
text. No layout program is needed, and the same model gives the same picture.
"""
