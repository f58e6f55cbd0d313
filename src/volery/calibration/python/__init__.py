"""What Python's operations take on the machine at hand: ``volery calibrate python``."""
