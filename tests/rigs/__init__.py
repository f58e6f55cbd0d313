"""What suites of several folders stand on: scripted and simulated vehicles, and ways to run a flight."""
