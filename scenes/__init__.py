"""The scene files that ship with warp_cloth; the meshes they name are generated when a scene is loaded."""
