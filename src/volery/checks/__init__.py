"""A model against all rules: those of its text, its system, its components' code and this machine.

The rules themselves are in ``volery.model.rules``. Those that need no more than the text are checked while
it is read; here are those that need a finished system, an analysis, or the machine.
"""
