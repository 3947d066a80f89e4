"""The scene schema: every key of a scene file, with its type, unit, bounds and default, and why that default.

scenes/keys.md lists the keys from here (scene/reference.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import (
    Field,
    PrivateAttr,
    StrictBool,
    field_validator,
    model_validator,
)

from warp_cloth.base import mesh_formats
from warp_cloth.scene.messages import refusal, show
from warp_cloth.scene.paths import checked_name, file_stem, is_name
from warp_cloth.scene.shapes import Integer, Real, Table
from warp_cloth.scene.wearables import AvatarSpec, GarmentSpec

AvatarCollision = Literal["depth", "auto", "mesh", "plain", "none"]
ClothCollision = Literal["auto"] | StrictBool
Method = Literal["auto", "multilevel", "accelerated", "direct"]
Precision = Literal["float32", "float64", "mixed"]
Start = Literal["auto", "placed", "dressed"]


class CollisionSpec(Table):
    """Contact: what cloth must not pass through, and how that is detected."""

    avatar: AvatarCollision = Field(
        default="auto",
        description="auto: depth, and more buffers where three miss too much; depth: three depth buffers fused into a "
        "distance field; mesh: exact, slower; plain: the paper's lookup; none.",
    )
    pixel_mm: Real = Field(
        default=2.0, ge=0.2, le=50, description="Pixel of the depth buffers [mm]; 2: below the offset, 1 MB a view."
    )
    offset_mm: Real = Field(
        default=3.0,
        ge=0,
        le=50,
        description="Gap between skin and cloth [mm]; 3: edges of 12 mm do not cut into the body.",
    )
    error_mm: Real = Field(
        default=1.5,
        gt=0,
        le=50,
        description="Error [mm] of auto, on 99.9 % of the skin near the garment; 1.5: half the offset.",
    )
    cloth: ClothCollision = Field(
        default="auto",
        description="Cloth meets cloth; auto: where it would cross; false: fewer iterations, but it may cross.",
    )

    @field_validator("cloth", mode="before")
    @classmethod
    def _cloth(cls, value: Any) -> Any:
        if value == "auto" or isinstance(value, bool):
            return value
        raise refusal(f'must be true, false or "auto", not {show(value)}', "leave it out, and the program decides")

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
    """How the rest shape is computed, and when it counts as found."""

    method: Method = Field(
        default="auto",
        description="auto: as the fit shows; accelerated: vertex by vertex; multilevel: coarse to fine, for loose or "
        "stiff cloth and fine meshes; direct: the paper's rule.",
    )
    start: Start = Field(
        default="auto",
        description="auto: sewn round the avatar where the mesh has it or, if limbs would be outside, round the avatar "
        "posed within the garment; placed: from the mesh; dressed: from its rest shape in jersey, which a batch shares "
        "(accelerated method, without collision.cloth and avatar.poses).",
    )
    iterations: Integer | None = Field(
        default=None,
        ge=0,
        le=10**7,
        description="Limit; by default a fit ends where it makes no more progress, at the latest after 200,000.",
    )
    tolerance_mm: Real = Field(
        default=1.0,
        gt=0,
        le=1e3,
        description="Rest: estimated distance to the rest shape [mm]; 1: garments are cut less exactly.",
    )
    residual: Real = Field(
        default=0.01, gt=0, le=1, description="Rest: relative residual force, rms; 0.01: forces balance to 1 %."
    )
    residual_p99: Real = Field(
        default=0.05, gt=0, le=1, description="Rest: its 99th percentile; 0.05: no region is far from rest."
    )
    precision: Precision = Field(
        default="mixed",
        description="mixed: float64 positions, float32 forces; float32 alone cannot balance fine stiff cloth.",
    )
    cap: Real | None = Field(
        default=None,
        ge=1e-7,
        le=1,
        description="Largest displacement in one iteration [m]; by default the method's.",
    )
    threads: Integer | None = Field(
        default=None,
        ge=1,
        le=64,
        description="CPU threads for one garment at most; by default one per core, if that is faster.",
    )

    @property
    def tolerance(self) -> float:
        """``tolerance_mm`` in metres."""
        return self.tolerance_mm * 1e-3


class Scene(Table):
    """A complete scene: what to fit, on what, and how."""

    name: str = Field(default="scene", description="Name of the output files; by default that of the scene file.")
    garments: tuple[GarmentSpec, ...] = Field(
        alias="garment", min_length=1, description="One garment, or several, inner to outer."
    )
    avatar: AvatarSpec | None = Field(default=None, description="The body; without one cloth hangs by its pins.")
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
        """Gives every garment a unique name; only names that the scene states can clash."""
        taken = [garment.name for garment in garments if garment.name]
        twice = [name for index, name in enumerate(taken) if name in taken[:index]]
        if twice:
            raise refusal(f"two garments have the same name, {show(twice[0])}", "give each a name of its own")
        named = []
        for garment in garments:
            name = stem = garment.name or _default_name(garment)
            count = 1
            while not garment.name and name in taken:
                count += 1
                name = f"{stem}_{count}"
            taken.append(name)
            named.append(garment if garment.name else garment.model_copy(update={"name": name}))
        return tuple(named)

    @model_validator(mode="after")
    def _avatar_to_collide_with(self) -> Scene:
        """Sets ``collision.avatar`` to "none" without an avatar, so that the settings show it."""
        if self.avatar is None and self.collision.avatar != "none":
            if "avatar" in self.collision.model_fields_set:
                raise refusal(
                    f"collision.avatar = {show(self.collision.avatar)}, but the scene has no [avatar]",
                    "add an [avatar], or remove collision.avatar",
                )
            object.__setattr__(self, "collision", self.collision.model_copy(update={"avatar": "none"}))
        return self

    @model_validator(mode="after")
    def _dressed_vertex_by_vertex(self) -> Scene:
        """Refuses a dressed start together with what it does not support."""
        if self.solver.start == "dressed":
            supported = {
                'solver.method = "accelerated"': self.solver.method in ("auto", "accelerated"),
                "collision.cloth = false": self.collision.cloth is not True,
                "no avatar.poses": self.avatar is None or not self.avatar.poses,
            }
            for needed in (text for text, given in supported.items() if not given):
                raise refusal(f'"dressed" needs {needed}', 'use "placed"', below="solver.start")
        return self

    @model_validator(mode="after")
    def _avatar_without_its_garments(self) -> Scene:
        """Refuses an avatar prim that contains a garment, or the reverse: one file may hold both."""
        if self.avatar is None or self.avatar.mesh is None or self.avatar.mesh.suffix.lower() not in mesh_formats.NAMED:
            return self
        whole = "" if self.avatar.prim is None else self.avatar.prim.rstrip("/")
        for garment in self.garments:
            if garment.mesh == self.avatar.mesh and f"{garment.prim or ''}/".startswith(f"{whole}/" if whole else ""):
                holds = f"{show(whole)} contains" if whole else f"all of {self.avatar.mesh.name} contains"
                raise refusal(f"{holds} the garment, too", "name the prim of the body alone", below="avatar.prim")
        for key, garment in zip(self.garment_keys, self.garments, strict=True):
            group = (garment.prim or "").rstrip("/")
            if garment.mesh == self.avatar.mesh and group and f"{whole}/".startswith(f"{group}/"):
                raise refusal(
                    f"{show(group)} contains the avatar, too", "name the prim of the garment alone", below=f"{key}.prim"
                )
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


def _default_name(garment: GarmentSpec) -> str:
    """As its author named it: by its prim, which tells two meshes of one file apart, else by its file."""
    if garment.shape is not None:
        return garment.shape.kind
    prim = (garment.prim or "").rpartition("/")[2]
    return prim if is_name(prim) else file_stem(garment.file)
