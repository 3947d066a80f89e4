"""What a mesh is a mesh of: a body's limbs, a garment's openings, and which limb passes through which opening."""
