"""The system model as frozen data with source lines."""
