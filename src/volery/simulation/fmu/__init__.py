"""FMUs that move bodies of the world: what they are asked for, their processes, their axes."""
