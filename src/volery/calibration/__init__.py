"""The paper's calibration method on the machine at hand. Not there yet."""
