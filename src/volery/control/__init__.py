"""The control laboratory: control laws, flights under them, their analysis and their tuning."""
