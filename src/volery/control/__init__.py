"""Controllers, flying code and safety switches. Not there yet."""
