"""The scene schema: every key of a scene file, with its type, unit, bounds, default and reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    Field,
    PrivateAttr,
    StrictBool,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)

from warp_cloth.base.errors import InputError
from warp_cloth.base.units import LENGTH_UNITS, METRES_PER, LengthUnit, UpAxis
from warp_cloth.garment.folds import RestAngles
from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.scene.messages import listed, refusal, show
from warp_cloth.scene.paths import checked_name, directory_of, path_from
from warp_cloth.scene.shapes import AvatarShape, GarmentShape, Integer, Point, Real, Table, VertexId
from warp_cloth.scene.stage import USD_SUFFIXES

RestShape = Literal["mesh", "uv", "physics"]
AvatarCollision = Literal["depth", "auto", "mesh", "plain", "none"]
Method = Literal["multilevel", "accelerated", "direct"]
Precision = Literal["float32", "float64", "mixed"]
Start = Literal["placed", "dressed"]
LoopSide = Literal["top", "bottom", "left", "right", "front", "back"]
Degrees = Annotated[Real, Field(ge=-360, le=360)]
LOOP_SIDES: tuple[LoopSide, ...] = get_args(LoopSide)
NAMED_MESHES = (*USD_SUFFIXES, ".glb", ".gltf")  # files whose meshes have names, so that one may hold a whole scene
FABRIC_KEYS = frozenset(field.name for field in fields(Fabric))


class PinSpec(Table):
    """Vertices that stay where they start; exactly one way of naming them."""

    vertices: tuple[VertexId, ...] | None = Field(default=None, min_length=1, description="vertex indices of the file")
    box: tuple[Point, Point] | None = Field(default=None, description="lowest and highest corner of a box [m]")
    loop: LoopSide | VertexId | None = Field(
        default=None,
        description="a boundary loop: the one furthest that way, or its rank by length, 0 the longest",
    )

    @field_validator("loop", mode="plain")
    @classmethod
    def _loop(cls, value: Any) -> Any:
        if value is None or value in LOOP_SIDES or (type(value) is int and 0 <= value < 2**31):
            return value
        raise refusal(f"{show(value)} names no boundary loop", f"use {listed(LOOP_SIDES)}, or a rank from 0 on")

    @field_validator("box", mode="after")
    @classmethod
    def _box(cls, value: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if value is not None and any(low > high for low, high in zip(*value, strict=True)):
            raise refusal("the first corner is not below the second on every axis", "give the lowest corner first")
        return value

    @model_validator(mode="after")
    def _one_way(self) -> PinSpec:
        if sum(way is not None for way in (self.vertices, self.box, self.loop)) != 1:
            raise refusal("a pin names its vertices in exactly one way", "give one of vertices, box, loop")
        return self


class Wearable(Table):
    """What a garment and an avatar share: a mesh from a file, or a shape that is generated."""

    mesh: Path | None = Field(
        default=None, description="mesh file (.obj .ply .stl .glb .gltf .usd*), relative to the scene file"
    )
    prim: str | None = Field(
        default=None,
        min_length=1,
        description="the mesh's prim path in a USD file, its object's name in a .glb or .gltf file; None: the only one",
    )
    units: LengthUnit | None = Field(
        default=None, description="the mesh file's length unit; None: stated by it, or guessed"
    )

    up: UpAxis | None = Field(
        default=None, description="axis that points up in an .obj, .ply or .stl file, which do not say it; None: y"
    )

    @field_validator("mesh", mode="plain")
    @classmethod
    def _mesh(cls, value: Any, info: ValidationInfo) -> Path | None:
        return path_from(value, info, "a mesh file")

    def _check_one_source(self, shape: object | None, kinds: str) -> None:
        """Exactly one of mesh and shape, and no key of a mesh file beside a shape."""
        if (self.mesh is None) == (shape is None):
            both = "mesh and shape are both given" if shape is not None else "neither mesh nor shape is given"
            raise refusal(both, f'give one: mesh = "FILE", or shape = {{kind = {kinds}}}')
        for key in ("prim", "units", "up"):
            if shape is not None and getattr(self, key) is not None:
                raise refusal(f"{key} says how to read a mesh file, but a shape is given", "leave it out", below=key)


class GarmentSpec(Wearable):
    """One garment: its mesh or shape, rest shape, fabric and pins."""

    name: str = Field(default="", description="name in the stage and the report; empty: the mesh file's or the shape's")
    shape: GarmentShape | None = Field(default=None, description="a generated garment instead of a mesh")
    rest: RestShape = Field(
        default="mesh",
        description="natural lengths: of the 3-D mesh as loaded, its 2-D panels, or the rest shape that a stage states",
    )
    rest_angles: RestAngles = Field(
        default="flat",
        description="cloth is flat at rest, or folded as in the mesh (pressed pleats) or as a stage states",
    )
    uv_units: LengthUnit | Real = Field(default="m", description="unit of the texture coordinates, or metres per unit")
    fabric: Fabric = Field(default="default", description="a shipped fabric, a .toml file, or a table of overrides")  # type: ignore[assignment]
    grain_degrees: Degrees = Field(
        default=0.0, description="turn of the warp from the panels' +v, counter-clockwise as drawn [degrees]"
    )
    grain_panels: Mapping[str, Degrees] = Field(
        default_factory=dict, description="the same of single panels, by name, e.g. {sleeve = 45}"
    )
    grain_texture: Path | None = Field(
        default=None, description="image over all panels whose hue turns the warp further: red 0, cyan 90 degrees"
    )
    pin: tuple[PinSpec, ...] = Field(default=(), description="vertices held where they start; none: nothing is held")

    @field_validator("uv_units", mode="plain")
    @classmethod
    def _uv_units(cls, value: Any) -> LengthUnit | float:
        if isinstance(value, str) and value in LENGTH_UNITS:
            return value
        if isinstance(value, int | float) and not isinstance(value, bool) and 1e-7 <= value <= 1e4:
            return float(value)
        raise refusal(
            f"{show(value)} is not a unit", f"use {listed(LENGTH_UNITS)}, or metres per unit from 1e-7 to 1e4"
        )

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
            # a table's own key, or one that it leaves out and that does not go with the ones it has
            in_table = isinstance(value, Mapping) and (error.place in value or error.place in FABRIC_KEYS)
            below, place = (error.place, "") if in_table else ("", error.place)
            raise refusal(error.problem, error.remedy, below=below, place=place) from error

    @field_serializer("fabric")
    def _fabric_values(self, fabric: Fabric) -> dict[str, Any]:
        return asdict(fabric)

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
        self._check_one_source(self.shape, '"square" or "tshirt"')
        return self

    @property
    def uv_metres(self) -> float:
        """Metres per unit of the texture coordinates."""
        return self.uv_units if isinstance(self.uv_units, float) else METRES_PER[self.uv_units]


class AvatarSpec(Wearable):
    """The body that wears the garments; where it has poses the garments are carried from one to the next."""

    shape: AvatarShape | None = Field(default=None, description="a generated avatar instead of a mesh")
    poses: tuple[Path, ...] | Literal["samples"] = Field(
        default=(),
        description="meshes of the same topology to go on to, in order; or the time samples of the USD mesh",
    )
    friction: Real = Field(
        default=0.5, ge=0, le=10, description="Coulomb friction of cloth on the avatar; 0.5: cloth on skin"
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
        self._check_one_source(self.shape, '"sphere" or "mannequin"')
        if self.shape is not None and self.poses:
            raise refusal("poses are of a mesh file, but a shape is given", "leave them out", below="poses")
        return self

    @property
    def place(self) -> str:
        """Where its mesh comes from, for messages: the file, or the scene key."""
        return "avatar" if self.mesh is None else str(self.mesh)


class CollisionSpec(Table):
    """What the cloth may not pass through, and how that is found."""

    avatar: AvatarCollision = Field(
        default="depth",
        description="three depth buffers fused into a field, more of them where needed, the exact mesh, the paper's "
        "plain look-up in the three, or none",
    )
    pixel_mm: Real = Field(default=2.0, ge=0.2, le=50, description="depth pixel [mm]; 2: below the offset, 1 MB a view")
    offset_mm: Real = Field(
        default=3.0, ge=0, le=50, description="gap kept to the avatar [mm]; 3: no piercing at 12 mm edges"
    )
    error_mm: Real = Field(
        default=1.5,
        gt=0,
        le=50,
        description='"auto" adds buffers until 99.9 % of the near surface is within this [mm]; 1.5: half the offset',
    )
    cloth: StrictBool = Field(
        default=False, description="contact of cloth with cloth; false: half the iterations, but folds may pass through"
    )

    @property
    def pixel(self) -> float:
        """``pixel_mm`` in metres."""
        return self.pixel_mm * 1e-3

    @property
    def offset(self) -> float:
        """``offset_mm`` in metres."""
        return self.offset_mm * 1e-3

    @property
    def error(self) -> float:
        """``error_mm`` in metres."""
        return self.error_mm * 1e-3


class SolverSpec(Table):
    """How the rest shape is looked for, and when it is found."""

    method: Method = Field(
        default="accelerated",
        description="multilevel: all vertices at once; accelerated: vertex by vertex; direct: the paper's own rule",
    )
    start: Start = Field(
        default="placed",
        description="placed: as the mesh is; dressed: as it rests in jersey, whence all fabrics have a shorter way; "
        "a batch shares that",
    )
    iterations: Integer = Field(
        default=20_000, ge=0, le=10**7, description="limit; a T-shirt on a body rests after about 8,000"
    )
    tolerance_mm: Real = Field(
        default=1.0, gt=0, le=1e3, description="rest error [mm]; 1: less than a garment is cut to"
    )
    residual: Real = Field(
        default=0.01, gt=0, le=1, description="relative residual rms, 1: nothing balanced; 0.01: to 1 %"
    )
    residual_p99: Real = Field(
        default=0.05, gt=0, le=1, description="its 99th percentile: no region that is far from rest"
    )
    precision: Precision = Field(
        default="mixed", description="mixed: positions in float64, all else in float32 (model: precision)"
    )
    cap: Real | None = Field(
        default=None,
        ge=1e-7,
        le=1,
        description="largest displacement an iteration [m]; None: chosen by the method",
    )
    threads: Integer | None = Field(
        default=None,
        ge=1,
        le=64,
        description="of the CPU that share a garment's iterations, at most; None: one a core, where that pays",
    )

    @property
    def tolerance(self) -> float:
        """``tolerance_mm`` in metres."""
        return self.tolerance_mm * 1e-3


class Scene(Table):
    """A whole scene, every value resolved: what to fit, on what, and how."""

    name: str = Field(default="scene", description="names the output files; the scene file's own name by default")
    garments: tuple[GarmentSpec, ...] = Field(alias="garment", min_length=1, description="inner to outer")
    avatar: AvatarSpec | None = Field(default=None, description="none: the cloth hangs by its pins")
    collision: CollisionSpec = Field(default_factory=CollisionSpec)
    solver: SolverSpec = Field(default_factory=SolverSpec)
    _directory: Path = PrivateAttr(default=Path())

    @field_validator("name")
    @classmethod
    def _name(cls, value: str) -> str:
        return checked_name(value)

    @field_validator("garments", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        return (value,) if isinstance(value, Mapping | GarmentSpec) else value

    @field_validator("garments")
    @classmethod
    def _named_apart(cls, garments: tuple[GarmentSpec, ...]) -> tuple[GarmentSpec, ...]:
        """Give every garment a name of its own; only names that the user stated can clash."""
        taken = [garment.name for garment in garments if garment.name]
        if len(set(taken)) < len(taken):
            raise refusal("two garments have the same name", "give each its own name")
        named = []
        for garment in garments:
            name = stem = garment.name or (garment.shape.kind if garment.shape else Path(garment.mesh or "").stem)
            count = 1
            while not garment.name and name in taken:
                count += 1
                name = f"{stem}_{count}"
            taken.append(name)
            named.append(garment if garment.name else garment.model_copy(update={"name": name}))
        return tuple(named)

    @model_validator(mode="after")
    def _avatar_to_collide_with(self) -> Scene:
        """Without an avatar its collision is "none", and said so in the settings."""
        if self.avatar is None and self.collision.avatar != "none":
            if "avatar" in self.collision.model_fields_set:
                raise refusal(
                    f"collision.avatar = {show(self.collision.avatar)}, but the scene has no [avatar]",
                    "add an [avatar], or leave collision.avatar out",
                )
            object.__setattr__(self, "collision", self.collision.model_copy(update={"avatar": "none"}))
        return self

    @model_validator(mode="after")
    def _dressed_vertex_by_vertex(self) -> Scene:
        """Refuse to dress what has a way of its own."""
        if self.solver.start == "dressed":
            ways = {
                'solver.method = "accelerated"': self.solver.method == "accelerated",
                "collision.cloth = false": not self.collision.cloth,
                "no avatar.poses": self.avatar is None or not self.avatar.poses,
            }
            for way in (way for way, taken in ways.items() if not taken):
                raise refusal(f'"dressed" goes with {way} only', 'use "placed"', below="solver.start")
        return self

    @model_validator(mode="after")
    def _avatar_without_its_garments(self) -> Scene:
        """Refuse an avatar that holds the garment, as where it is all of a file that holds both."""
        if self.avatar is None or self.avatar.mesh is None or self.avatar.mesh.suffix.lower() not in NAMED_MESHES:
            return self
        whole = "" if self.avatar.prim is None else self.avatar.prim.rstrip("/")
        for garment in self.garments:
            if garment.mesh == self.avatar.mesh and f"{garment.prim or ''}/".startswith(f"{whole}/" if whole else ""):
                holds = f"{show(whole)} holds" if whole else f"all of {self.avatar.mesh.name} includes"
                raise refusal(f"{holds} the garment, too", "name the body alone", below="avatar.prim")
        for key, garment in zip(self.garment_keys, self.garments, strict=True):
            group = (garment.prim or "").rstrip("/")
            if garment.mesh == self.avatar.mesh and group and f"{whole}/".startswith(f"{group}/"):
                raise refusal(f"{show(group)} holds the avatar, too", "name the garment alone", below=f"{key}.prim")
        return self

    def model_post_init(self, context: Any, /) -> None:
        self._directory = (context or {}).get("directory", Path())

    @property
    def directory(self) -> Path:
        """Folder that the scene's relative paths start from."""
        return self._directory

    @property
    def garment_keys(self) -> tuple[str, ...]:
        """The scene key of each garment, for messages: "garment", or "garment[0]" where there are more."""
        many = len(self.garments) > 1
        return tuple(f"garment[{index}]" if many else "garment" for index in range(len(self.garments)))

    def settings(self) -> dict[str, Any]:
        """Every value used, defaults included, as plain JSON values; ``garment`` is always a list."""
        return self.model_dump(mode="json", by_alias=True)
