"""The command line: parse, wire, show; no logic of its own."""
