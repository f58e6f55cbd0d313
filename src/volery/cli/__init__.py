"""The command line: parse, wire, show. It has no logic of its own.

Each command is one module and imports what it calls when it is called, so that ``volery --help`` is quick.
"""
