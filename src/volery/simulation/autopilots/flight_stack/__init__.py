"""The simulated flight stack: estimator, cascaded control, modes, and what all dialects of it share."""
