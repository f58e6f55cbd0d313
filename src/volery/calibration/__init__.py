"""Calibration on the machine at hand: measured costs for the catalogue, and validation of estimates."""
