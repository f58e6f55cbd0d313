"""The commands of ``volery``. See ``volery.cli.command`` for how to add one."""
