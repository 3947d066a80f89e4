"""Options of ``warp-cloth fabric`` that describe a drape test, of which a fabric is made."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError

BOUNDS = {  # of the numbers, beyond which they are mistaken units
    "drape_coefficient": (1.0, 100.0),
    "folds": (1.0, 30.0),
    "weight_gsm": (5.0, 5000.0),
    "support_mm": (20.0, 2000.0),
    "disc_mm": (30.0, 4000.0),
    "warp_degrees": (-360.0, 360.0),
    "mm_per_pixel": (1e-3, 10.0),
    "camera_mm": (200.0, 1e5),
}


@dataclass(frozen=True)
class DrapeTest:
    """What the command line says of a drape test; each field is an option."""

    from_drape: Annotated[
        Path | None, typer.Option(metavar="PHOTO...", help="Make a fabric from photographs of its drape, from above.")
    ] = None
    drape_coefficient: Annotated[
        float | None, typer.Option(help="Make a fabric from a measured drape coefficient, in %.")
    ] = None
    folds: Annotated[int | None, typer.Option(help="With --drape-coefficient: folds that were counted.")] = None
    weight_gsm: Annotated[float | None, typer.Option(help="Weight of the fabric to make, in g/m2.")] = None
    base: Annotated[str | None, typer.Option(help="Fabric of the same class: stretch and shear are taken from it.")] = (
        None
    )
    support_mm: Annotated[float, typer.Option(help="Diameter of the support, and of the plate on it, in mm.")] = 180.0
    disc_mm: Annotated[float, typer.Option(help="Diameter of the disc of cloth, in mm.")] = 300.0
    warp_degrees: Annotated[
        float, typer.Option(help="Direction of the warp in the photographs, from right, counter-clockwise.")
    ] = 90.0
    mm_per_pixel: Annotated[
        float | None, typer.Option(help="Scale of the photographs.", show_default="from the plate's edge")
    ] = None
    camera_mm: Annotated[
        float | None,
        typer.Option(help="Distance of the camera from the plate.", show_default="from the photograph's EXIF data"),
    ] = None

    @property
    def makes_fabric(self) -> bool:
        """Whether a fabric is to be made."""
        return self.from_drape is not None or self.drape_coefficient is not None

    def check(self) -> None:
        """Refuses what does not go together, and numbers in other units.

        Raises:
            InputError: an option is wrong.
        """
        if self.from_drape is not None and self.drape_coefficient is not None:
            raise InputError("--drape-coefficient", "is given with photographs", "give one of them")
        if self.folds is not None and self.from_drape is not None:
            raise InputError("--folds", "is given with photographs, which show them", "remove it")
        if self.weight_gsm is None:
            raise InputError("--weight-gsm", "is missing: a drape tells bending over weight", "weigh the disc")
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not (low <= value <= high and math.isfinite(value)):
                option = f"--{name.replace('_', '-')}"
                raise InputError(option, f"must be a number from {low:g} to {high:g}, not {value:g}")
