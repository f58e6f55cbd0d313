"""Flight stack of a simulated autopilot: estimator, guidance, attitude control and the compiled step."""
