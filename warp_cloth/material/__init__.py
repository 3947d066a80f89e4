"""What cloth is made of: fabrics as files state them, and the constants of edges, threads and hinges from them."""
