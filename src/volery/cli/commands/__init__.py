"""What each command is called, takes, and tells ``--help``.

What it does stands in a module of ``volery.cli``, imported when it is called: ``--help`` is quick.
"""
