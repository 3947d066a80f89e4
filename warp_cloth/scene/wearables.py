"""Schema of what is worn and who wears it: garments, their pins, and the avatar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import Field, ValidationInfo, field_serializer, field_validator, model_validator

from warp_cloth.base.errors import InputError
from warp_cloth.base.units import LENGTH_UNITS, METRES_PER, BodyUp, LengthUnit, UpAxis
from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.scene.messages import listed, refusal, show
from warp_cloth.scene.paths import checked_name, directory_of, path_from
from warp_cloth.scene.shapes import AvatarShape, BodyMeasures, GarmentShape, Integer, Point, Real, Table, VertexId

if TYPE_CHECKING:
    from warp_cloth.pattern import DraftOptions

RestShape = Literal["auto", "mesh", "uv", "physics"]
RestAngles = Literal["flat", "mesh", "physics"]
UvUnit = Literal["auto", LengthUnit]
UV_UNITS: tuple[UvUnit, ...] = ("auto", *LENGTH_UNITS)
LoopSide = Literal["top", "bottom", "left", "right", "front", "back"]
Place = Literal[
    "front", "back", "left_front", "right_front", "left_back", "right_back", "side_front", "left_side_front",
    "right_side_front", "side_back", "left_side_back", "right_side_back", "sleeve", "left_sleeve", "right_sleeve",
    "under_sleeve", "left_under_sleeve", "right_under_sleeve", "leg_front", "left_leg_front", "right_leg_front",
    "leg_back", "left_leg_back", "right_leg_back", "leg", "left_leg", "right_leg", "skirt_front", "skirt_back", "hood",
    "left_hood", "right_hood", "yoke", "collar", "waistband", "hem_band", "cuff", "left_cuff", "right_cuff", "none",
    "side_skirt_front", "side_skirt_back", "gore", "stand", "fall", "front_yoke", "front_sleeve",
    "left_front_sleeve", "right_front_sleeve", "back_sleeve", "left_back_sleeve", "right_back_sleeve",
]  # fmt: skip
Copies = Annotated[Integer, Field(ge=0, le=50)]
Degrees = Annotated[Real, Field(ge=-360, le=360)]
LOOP_SIDES: tuple[LoopSide, ...] = get_args(LoopSide)
# GarmentCode simulates its designs at this: 7,000 vertices for a T-shirt and trousers, and folds of 6 cm
PATTERN_EDGE_MM = 15.0
MOST_SIDES = 8  # of a seam; as many layers as a GarmentCode stitch may name
FABRIC_KEYS = frozenset(field.name for field in fields(Fabric))


class PinSpec(Table):
    """Vertices that stay where they start, named in exactly one way."""

    vertices: tuple[VertexId, ...] | None = Field(
        default=None, min_length=1, description="Vertex numbers of the mesh file, from 0."
    )
    box: tuple[Point, Point] | None = Field(
        default=None, description="Lowest and highest corner of a box [m]: all vertices inside."
    )
    loop: LoopSide | VertexId | None = Field(
        default=None,
        description="A boundary loop, by side (left and right are the wearer's) or by rank, 0 the longest.",
    )

    @field_validator("loop", mode="plain")
    @classmethod
    def _loop(cls, value: Any) -> Any:
        if value is None or value in LOOP_SIDES or (type(value) is int and 0 <= value < 2**31):
            return value
        raise refusal(f"{show(value)} is not a boundary loop", f"use {listed(LOOP_SIDES)}, or a rank from 0")

    @field_validator("box", mode="after")
    @classmethod
    def _box(cls, value: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if value is not None and any(low > high for low, high in zip(*value, strict=True)):
            raise refusal("the first corner is above the second on some axis", "give the lowest corner first")
        return value

    @model_validator(mode="after")
    def _one_way(self) -> PinSpec:
        if sum(way is not None for way in (self.vertices, self.box, self.loop)) != 1:
            raise refusal("a pin needs exactly one of vertices, box and loop", "give one of them")
        return self


class SeamSpec(Table):
    """A seam of a DXF pattern: two runs of edges that are sewn together, or more, as layers."""

    sew: tuple[str, ...] = Field(
        description='Its 2 to 8 sides, each "PIECE EDGE" or several joined by +: ["SLEEVE 2", "BACK 3 + FRONT 5"].',
    )
    right_to_wrong: bool = Field(default=False, description="Whether right side is sewn to wrong side.")

    @field_validator("sew", mode="after")
    @classmethod
    def _sides(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if not 2 <= len(value) <= MOST_SIDES:
            raise refusal(f"a seam has 2 to {MOST_SIDES} sides, not {len(value)}", "name what is sewn together")
        return value


class PieceSpec(Table):
    """A piece of a DXF pattern: what it covers, and how often it is cut."""

    name: str = Field(min_length=1, description="Its name in the file.")
    place: Place | None = Field(default=None, description="What it covers; else by name and shape.")
    copies: tuple[Copies, Copies] | None = Field(
        default=None,
        description="How often it is cut as drawn, and mirrored: [1, 1] a pair, [6, 0] six gores; "
        "by default as stated.",
    )
    darts: bool = Field(default=True, description="Whether a V or diamond of inner lines is a dart.")


class Wearable(Table):
    """Keys that garment and avatar share: a mesh from a file, or a generated shape."""

    mesh: Path | None = Field(
        default=None,
        description="Mesh file: .obj .ply .stl .glb .gltf .usd .usda .usdc .usdz, relative to the scene file.",
    )
    prim: str | None = Field(
        default=None,
        min_length=1,
        description="USD prim path or name in a .glb, .gltf or .obj, of a mesh or group; by default the only mesh.",
    )
    units: LengthUnit | None = Field(
        default=None,
        description="Unit of the mesh file; by default as the file states, else as its size and the body show.",
    )

    @field_validator("mesh", mode="plain")
    @classmethod
    def _mesh(cls, value: Any, info: ValidationInfo) -> Path | None:
        return path_from(value, info, "a mesh file")

    def _check_one_source(self, others: Mapping[str, object | None], remedy: str) -> None:
        """Refuses all but one of mesh and the ``others``, and keys of a mesh file without one."""
        sources = {"mesh": self.mesh, **others}
        given = [key for key, value in sources.items() if value is not None]
        if not given:
            raise refusal(f"neither {' nor '.join(sources)} is given", f'give one: mesh = "FILE", {remedy}')
        if len(given) > 1:
            raise refusal(f"{given[0]} and {given[1]} are both given", f'give one: mesh = "FILE", {remedy}')
        for key in ("prim", "units", "up"):
            if self.mesh is None and getattr(self, key) is not None:
                raise refusal(f"{key} is for a mesh file, but a {given[0]} is given", "remove it", below=key)


class GarmentSpec(Wearable):
    """One garment: its mesh or shape, rest shape, fabric and pins."""

    up: UpAxis | None = Field(
        default=None,
        description="Up axis of .obj, .ply or .stl, which cannot state it; by default y, or as the body shows.",
    )
    name: str = Field(default="", description="Name in stage and report; by default that of prim, file or shape.")
    shape: GarmentShape | None = Field(default=None, description="A generated garment instead of a mesh; keys below.")
    pattern: Path | None = Field(
        default=None,
        description="A sewing pattern instead of a mesh: a GarmentCode *_specification.json, or a .dxf of pieces.",
    )
    edge_mm: Real | None = Field(
        default=None,
        ge=2,
        le=60,
        description=f"Edges of a pattern's mesh [mm], default {PATTERN_EDGE_MM:g}; longer ones of a file are divided.",
    )
    open_ends: bool = Field(
        default=False, description="Leaves out flat patches that close ends; by default where limbs pass."
    )
    size: str | None = Field(
        default=None, min_length=1, max_length=40, description="Size of a DXF pattern; by default the sample's."
    )
    seam_allowance_mm: Real | None = Field(
        default=None,
        ge=0,
        le=100,
        description="Seam allowance of a DXF pattern's pieces without a sew line; default 0.",
    )
    seam: tuple[SeamSpec, ...] = Field(
        default=(), description="Seams of a DXF pattern; by default as proposed, where sure enough. Keys below."
    )
    piece: tuple[PieceSpec, ...] = Field(
        default=(), description="What pieces of a DXF pattern are, where names and shapes do not show it; keys below."
    )
    translate: Point = Field(default=(0.0, 0.0, 0.0), description="Moved by [m], as loaded: x y z, y up.")
    rotate: tuple[Degrees, Degrees, Degrees] = Field(
        default=(0.0, 0.0, 0.0),
        description="Turned by [degrees] about the origin: about x, then y, then z; before translate.",
    )
    scale: Real = Field(
        default=1.0,
        ge=1e-5,
        le=1e5,
        description="Lengths times this, at rest too; before rotate. Units are guessed of the mesh so scaled.",
    )
    rest: RestShape = Field(
        default="auto",
        description="Natural lengths: as modelled, of panels in texture space (uv), or a USD rest "
        "shape; auto: as the mesh shows.",
    )
    rest_angles: RestAngles = Field(
        default="flat",
        description="Rest angles: flat, as modelled (pressed pleats), or as a USD stage states.",
    )
    uv_units: UvUnit | Real = Field(
        default="auto",
        description="Unit of the texture coordinates, or metres per unit; auto: as the mesh shows.",
    )
    fabric: Fabric = Field(default="default", description="A shipped fabric, a .toml file, or a table of values.")  # type: ignore[assignment]
    grain_degrees: Degrees = Field(
        default=0.0, description="Angle of the warp from the panels' +v axis, counter-clockwise [degrees]."
    )
    grain_panels: Mapping[str, Degrees] = Field(
        default_factory=dict, description="The same for single panels, by name: {sleeve = 45}."
    )
    grain_texture: Path | None = Field(
        default=None, description="Image over all panels whose hue adds to the angle: red 0, cyan 90 degrees."
    )
    pin: tuple[PinSpec, ...] = Field(
        default=(), description="Vertices that stay where they start: one table or a list; keys below."
    )

    @field_validator("uv_units", mode="plain")
    @classmethod
    def _uv_units(cls, value: Any) -> UvUnit | float:
        if isinstance(value, str) and value in UV_UNITS:
            return value
        if isinstance(value, int | float) and not isinstance(value, bool) and 1e-7 <= value <= 1e4:
            return float(value)
        raise refusal(f"{show(value)} is not a unit", f"use {listed(UV_UNITS)}, or metres per unit from 1e-7 to 1e4")

    @field_validator("pattern", mode="plain")
    @classmethod
    def _pattern(cls, value: Any, info: ValidationInfo) -> Path | None:
        return path_from(value, info, "a pattern file")

    @field_validator("grain_texture", mode="plain")
    @classmethod
    def _texture(cls, value: Any, info: ValidationInfo) -> Path | None:
        return path_from(value, info, "an image")

    @field_validator("fabric", mode="plain")
    @classmethod
    def _fabric(cls, value: Any, info: ValidationInfo) -> Fabric:
        try:
            return resolve_fabric(value, directory_of(info))
        except InputError as error:
            # a key of the table, or one that it omits and that conflicts with its keys
            in_table = isinstance(value, Mapping) and (error.place in value or error.place in FABRIC_KEYS)
            below, place = (error.place, "") if in_table else ("", error.place)
            raise refusal(error.problem, error.remedy, below=below, place=place) from error

    @field_serializer("fabric")
    def _fabric_values(self, fabric: Fabric) -> dict[str, Any]:
        return asdict(fabric)

    @field_validator("size", mode="before")
    @classmethod
    def _size(cls, value: Any) -> Any:
        return str(value) if type(value) is int and 0 <= value < 1000 else value

    @field_validator("seam", "piece", mode="before")
    @classmethod
    def _tables(cls, value: Any) -> Any:
        return (value,) if isinstance(value, Mapping) else value

    @field_validator("pin", mode="before")
    @classmethod
    def _pins(cls, value: Any) -> Any:
        return (value,) if isinstance(value, Mapping | PinSpec) else value

    @field_validator("name")
    @classmethod
    def _name(cls, value: str) -> str:
        return checked_name(value) if value else value

    @model_validator(mode="after")
    def _source(self) -> GarmentSpec:
        kinds = 'shape = {kind = "square" or "tshirt"}'
        self._check_one_source({"pattern": self.pattern, "shape": self.shape}, f'pattern = "FILE", or {kinds}')
        if self.shape is not None and self.edge_mm is not None:
            raise refusal("edge_mm is for a mesh or a pattern", "set shape.edge_mm", below="edge_mm")
        if self.open_ends and self.mesh is None:
            raise refusal("open_ends is for a mesh", "remove it", below="open_ends")
        self._check_drafted()
        for key, plain in (("rest", "uv"), ("uv_units", "m")):
            if self.pattern is not None and getattr(self, key) not in ("auto", plain):
                raise refusal("a pattern is its own rest shape, in metres", "remove it", below=key)
        return self

    def _check_drafted(self) -> None:
        """Refuses keys of a DXF pattern without one, and pieces that are stated twice."""
        if not self.is_drafted:
            for key in ("size", "seam_allowance_mm", "seam", "piece"):
                if getattr(self, key) not in (None, ()):
                    remedy = "set shape.size" if key == "size" and self.shape is not None else "remove it"
                    raise refusal(f"{key} is for a DXF pattern, and none is given", remedy, below=key)
        names = [piece.name for piece in self.piece]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise refusal(f"{show(twice)} is stated twice", "state each piece once", below="piece")

    @property
    def is_drafted(self) -> bool:
        """Whether it is a pattern of pieces alone, which are laid round the body."""
        if self.pattern is None:
            return False
        from warp_cloth.pattern import is_drafted  # fifty modules that few scenes need

        return is_drafted(self.pattern)

    @property
    def is_laid_round(self) -> bool:
        """Whether the body decides where its panels start: no place of them is stated."""
        from warp_cloth.pattern import may_be_laid_round

        return self.pattern is not None and may_be_laid_round(self.pattern)

    @property
    def draft_options(self) -> DraftOptions:
        """What the scene states of a DXF pattern."""
        from warp_cloth.pattern import DraftOptions

        if not self.is_drafted:
            return DraftOptions()
        from warp_cloth.pattern.draft import Stated
        from warp_cloth.pattern.joints import StatedSeam

        return DraftOptions(
            self.size,
            1e-3 * (self.seam_allowance_mm or 0.0),
            tuple(StatedSeam(seam.sew, seam.right_to_wrong) for seam in self.seam),
            {piece.name: Stated(piece.place, piece.copies, piece.darts) for piece in self.piece},
        )

    @property
    def file(self) -> Path | None:
        """The file that the garment comes from."""
        return self.mesh if self.mesh is not None else self.pattern

    @property
    def grade_table(self) -> Path | None:
        """The grade rules of a DXF pattern, where they lie next to it."""
        if self.pattern is None or not self.is_drafted:
            return None
        from warp_cloth.pattern import grade_table_path

        return grade_table_path(self.pattern)

    @property
    def edge(self) -> float:
        """Edge length of a pattern's mesh, or the longest of a file's where it is stated [m]."""
        return (PATTERN_EDGE_MM if self.edge_mm is None else self.edge_mm) * 1e-3

    @property
    def uv_metres(self) -> float | None:
        """Metres per unit of the texture coordinates; None: as the mesh shows."""
        if self.uv_units == "auto":
            return None
        return self.uv_units if isinstance(self.uv_units, float) else METRES_PER[self.uv_units]


class AvatarSpec(Wearable):
    """The body that wears the garments; with poses, it moves and the garments follow."""

    up: BodyUp | None = Field(
        default=None,
        description='Likewise; "-y": upside down.',
    )
    shape: AvatarShape | None = Field(default=None, description="A generated avatar instead of a mesh; keys below.")
    measures: BodyMeasures | None = Field(
        default=None, description="A person's measures instead of a mesh: a mannequin that has them; keys below."
    )
    poses: tuple[Path, ...] | Literal["samples"] = Field(
        default=(),
        description="Later poses: mesh files of the same topology, in order, or the USD mesh's time samples.",
    )
    friction: Real = Field(
        default=0.5, ge=0, le=10, description="Friction coefficient of cloth on the avatar; 0.5: cloth on skin."
    )

    @field_validator("poses", mode="plain")
    @classmethod
    def _poses(cls, value: Any, info: ValidationInfo) -> Any:
        if value == "samples":
            return value
        entries = value if isinstance(value, list | tuple) else (value,)
        return tuple(path_from(entry, info, "a mesh file") for entry in entries if entry is not None)

    @field_serializer("poses")
    def _pose_values(self, poses: tuple[Path, ...] | str) -> str | list[str]:
        return poses if isinstance(poses, str) else [str(pose) for pose in poses]

    @model_validator(mode="after")
    def _source(self) -> AvatarSpec:
        if self.shape is not None and self.measures is not None:
            raise refusal("shape and measures are both given", "give one of them", below="measures")
        if self.measures is not None and not self.measures.model_dump(exclude_none=True):
            raise refusal("no measure is stated", "give stature, chest, waist or hip [m]", below="measures")
        self._check_one_source({"shape": self.shape or self.measures}, 'or shape = {kind = "sphere" or "mannequin"}')
        if self.mesh is None and self.poses:
            raise refusal("poses are for a mesh file, but a shape is given", "remove them", below="poses")
        return self

    @property
    def place(self) -> str:
        """Its mesh file, or its scene key, for messages."""
        return "avatar" if self.mesh is None else str(self.mesh)
