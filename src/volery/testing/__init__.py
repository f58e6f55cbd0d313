"""Conformance suites and fakes as library code."""
