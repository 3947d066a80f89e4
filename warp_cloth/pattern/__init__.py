"""Sewing patterns: flat panels and their stitches, read, meshed, placed and sewn."""

from warp_cloth.pattern.assembly import (
    is_drafted,
    load_pattern,
    may_be_laid_round,
    read_drafted,
    read_pattern,
    sewn_mesh,
    sewn_pattern,
)
from warp_cloth.pattern.draft_options import DraftOptions
from warp_cloth.pattern.figure import figure_of
from warp_cloth.pattern.grade_table import grade_table_path

__all__ = [
    "DraftOptions",
    "figure_of",
    "grade_table_path",
    "is_drafted",
    "load_pattern",
    "may_be_laid_round",
    "read_drafted",
    "read_pattern",
    "sewn_mesh",
    "sewn_pattern",
]
