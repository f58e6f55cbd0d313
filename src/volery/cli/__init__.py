"""The command line: parse options, call the library, show results.

The commands are in ``volery.cli.commands``, one file for each subject; the other files are shared by them.
"""
