"""Studies of a user's own scene: what it needs, what accuracy costs, where it ends."""
