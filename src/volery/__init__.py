"""volery: model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers."""
