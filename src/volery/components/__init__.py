"""How a user's file becomes a running process."""
