"""Schema of generated shapes in a scene; warp_cloth.shapes generates them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _as_integer(value: Any) -> Any:
    """Converts a float with an integer value, as 1e3 or a table's 1000.0, where that is exact."""
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 2**53 else value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]  # takes 3 for 3.0, but no text, no true
Integer = Annotated[int, Field(strict=True), BeforeValidator(_as_integer)]
Coordinate = Annotated[Real, Field(ge=-1e7, le=1e7)]  # [m]
Point = tuple[Coordinate, Coordinate, Coordinate]
VertexId = Annotated[Integer, Field(ge=0, le=2**31 - 1)]

SIZES: tuple[Literal["S", "M", "L"], ...] = ("S", "M", "L")
Size = Annotated[
    Literal["S", "M", "L"], BeforeValidator(lambda value: value.upper() if isinstance(value, str) else value)
]


class Table(BaseModel):
    """A table of a scene file: immutable, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


class SquareShape(Table):
    """A flat square cloth: a regular grid with alternating diagonals."""

    kind: Literal["square"]
    side: Real = Field(default=1.0, ge=1e-3, le=100, description="Side length [m].")
    vertices_per_side: Integer = Field(
        default=33, ge=2, le=2049, description="Vertices along a side; 33 on 1 m: edges of 31 mm."
    )
    plane: Literal["horizontal", "vertical"] = Field(default="horizontal", description="Lies flat, or hangs facing +z.")
    height: Real = Field(
        default=1.0,
        ge=-1e6,
        le=1e6,
        description="Height of a horizontal square, or of the top edge of a vertical one [m].",
    )


class TshirtShape(Table):
    """The shipped T-shirt: flat panels, sewn, placed round the mannequin."""

    kind: Literal["tshirt"]
    size: Size = Field(default="M", description="Garment size.")
    edge_mm: Real = Field(
        default=12.0, ge=2, le=60, description="Edge length [mm]; 12: folds of 5 cm, about 8,000 vertices."
    )


class SphereShape(Table):
    """A sphere to drape cloth over."""

    kind: Literal["sphere"]
    radius: Real = Field(default=0.3, ge=1e-3, le=100, description="Radius [m].")
    centre: Point = Field(default=(0.0, 0.6, 0.0), description="Centre [m].")
    edge_mm: Real = Field(default=20.0, ge=1, le=1e4, description="Edge length [mm]; 20 on 0.3 m: round to 0.2 mm.")


class MannequinShape(Table):
    """The shipped mannequin: the standard body of a size, or your own measures."""

    kind: Literal["mannequin"]
    size: Size = Field(default="M", description="The standard body that has the measures left out.")
    stature: Real | None = Field(default=None, ge=1.2, le=2.3, description="Body height [m].")
    chest: Real | None = Field(default=None, ge=0.7, le=1.5, description="Chest girth [m].")
    waist: Real | None = Field(default=None, ge=0.5, le=1.5, description="Waist girth [m].")
    hip: Real | None = Field(default=None, ge=0.7, le=1.6, description="Hip girth [m].")
    arm_angle_degrees: Real = Field(
        default=45.0,
        ge=40,
        le=85,
        description="Angle of the arms from straight down [degrees]; 45: A-pose.",
    )


class BodyMeasures(Table):
    """Stated measures of a person: a mannequin has them when it is measured; the rest is the likeliest."""

    stature: Real | None = Field(default=None, ge=1.2, le=2.3, description="Body height [m].")
    chest: Real | None = Field(default=None, ge=0.7, le=1.5, description="Bust or chest girth, the fullest [m].")
    waist: Real | None = Field(default=None, ge=0.5, le=1.5, description="Girth of the natural waist [m].")
    hip: Real | None = Field(default=None, ge=0.7, le=1.6, description="Hip girth, the fullest [m].")


GarmentShape = Annotated[SquareShape | TshirtShape, Field(discriminator="kind")]
AvatarShape = Annotated[SphereShape | MannequinShape, Field(discriminator="kind")]
