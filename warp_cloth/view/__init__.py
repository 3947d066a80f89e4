"""A page on this machine on which the garment drapes live."""
