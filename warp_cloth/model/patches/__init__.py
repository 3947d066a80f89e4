"""Domain decomposition of the cloth into patches, one per block of threads: their elements and memory layout."""
