"""A garment on the host: its rest shape, grain, folds, pins, confines, from a checked scene to what a model needs."""
