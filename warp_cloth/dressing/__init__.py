"""A body posed so that every limb lies inside the part of a garment that is for it."""
