"""Fabrics from drape tests: from a photograph taken from above, or from the numbers of a drape meter."""
