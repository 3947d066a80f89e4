"""A garment on the host: its rest shape, grain, folds, pins and reach, from a checked scene to what a model needs."""
