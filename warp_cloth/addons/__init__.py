"""Add-ons for other programs, a file each: installed there, they call the ``warp-cloth`` command."""
