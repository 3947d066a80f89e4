"""The length unit of a DXF file: as it states, where its pieces are then of a garment's size, else as that shows."""

from __future__ import annotations

import re

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.dxf import Drawing
from warp_cloth.pattern.dxf_drawn import CUT, SEW

INCH = 0.0254
# Metres in a unit of $INSUNITS
CODES = {1: INCH, 2: 12 * INCH, 4: 1e-3, 5: 1e-2, 6: 1.0, 14: 0.1}
LIKELY = (0.12, 4.0)  # [m] extent of a garment's largest piece
USUAL = 0.8  # [m], where several units are possible
# Units of plotters [m] and their names, taken where none is stated and no other one makes a garment
TENTHS = {1e-4: "0.1 mm", 0.1 * INCH: "0.1 inch", 0.01 * INCH: "0.01 inch"}
METRIC_MM = 180.0  # extent above which "metric" means millimetres: a coat in centimetres, a baby's in millimetres


def unit_of(file: str, drawing: Drawing) -> tuple[float, list[str]]:
    """Metres in a unit of the file: as stated where the pieces are then of a garment's size, else as that shows."""
    extents = [
        float(np.ptp(np.concatenate(drawn.lines.get(CUT) or drawn.lines[SEW]), axis=0).max())
        for drawn in drawing.pieces
    ]
    extent = max(extents)
    said = " ".join((drawing.stated.get("units", ""), *(drawn.said("units", "unit") for drawn in drawing.pieces)))
    said = said.strip().lower()
    code = CODES.get(drawing.unit_code)
    stated: list[float] = []
    if re.search(r"english|imperial|inch|\bin\b", said):
        stated = [INCH]
    elif re.search(r"(\b0?[.,]1|\b1/10) ?mm", said):
        stated = [1e-4]
    elif re.search(r"\bmm\b|millimet", said):
        stated = [1e-3]
    elif re.search(r"\bcm\b|centimet", said):
        stated = [1e-2]
    elif "metric" in said:  # millimetres by the standard; CLO writes centimetres under the same word
        code = code if code in (1e-3, 1e-2, 1.0) else None
        usual = 1e-3 if extent > METRIC_MM else 1e-2  # also where the code beside the word makes no garment
        stated = [usual] if code is None else [code, usual]
    stated += [code] if code is not None else []
    for metres in stated:
        if LIKELY[0] <= extent * metres <= LIKELY[1]:
            return metres, []
    units = [m for m in (1e-3, 1e-2, INCH, 1.0) if LIKELY[0] <= extent * m <= LIKELY[1]]
    if not units and not stated:  # a house in millimetres is no garment in tenths of them
        units = [m for m in TENTHS if LIKELY[0] <= extent * m <= LIKELY[1]]
    guess = min(units, key=lambda m: abs(np.log(extent * m / USUAL)), default=None)
    if guess is None:
        across = f"{extent:.4g} units"
        raise InputError(file, f"its largest piece is {across} across, which is no garment's size in any unit",
                         "export it in millimetres")  # fmt: skip
    names = {1e-3: "mm", 1e-2: "cm", INCH: "inch", 1.0: "m"} | TENTHS
    why = "the stated unit would make no garment" if stated else "no unit is stated"
    return guess, [f"{why}: {names[guess]} assumed, as its largest piece is then {extent * guess:.2f} m"]
