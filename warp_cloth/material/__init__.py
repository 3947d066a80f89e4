"""What cloth is made of: fabrics as files state them, and the constants of edges, yarns and hinges from them."""
