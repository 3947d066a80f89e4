"""All Warp kernels and device functions of warp_cloth, imported as ``warp_cloth.kernels``."""

if __name__ != "warp_cloth.kernels":
    raise ImportError("import these kernels as warp_cloth.kernels; the folder is mapped there by pyproject.toml")
