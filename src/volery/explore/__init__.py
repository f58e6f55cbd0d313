"""Design-space exploration: campaigns of many runs over seeds and variants of a model, and what they show."""
