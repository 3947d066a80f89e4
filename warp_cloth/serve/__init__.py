"""A service: bodies come in over HTTP, the verdicts of a product's sizes, fit maps and meshes go out."""
