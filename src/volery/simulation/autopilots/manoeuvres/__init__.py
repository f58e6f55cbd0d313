"""Ways of flying and driving.

Each turns what is asked and what is believed into set-points, ten times a second.
"""
