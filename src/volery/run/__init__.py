"""Joins everything: simulate() and fly(). The only room that sees every other."""
