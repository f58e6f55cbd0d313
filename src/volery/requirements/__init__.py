"""Bounds as folds over the event stream: the same code while running and from a trace read back."""
