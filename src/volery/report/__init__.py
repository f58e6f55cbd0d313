"""Tables, plots and one HTML document, from a trace alone."""
