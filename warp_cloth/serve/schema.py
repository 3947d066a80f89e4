"""What a request holds, and what an answer does: the models of the OpenAPI page."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from warp_cloth.base.units import LengthUnit, UpAxis
from warp_cloth.scene.messages import refusal
from warp_cloth.scene.shapes import BodyMeasures, Real, Table

MeshFormat = Literal["obj", "ply", "stl", "glb"]  # not those that may name other files
Contents = Literal["none", "garment", "worn"]
MOST_SIZES = 16

Text = Annotated[str, Field(max_length=200)]


class MeshFile(Table):
    """A mesh file, as bytes."""

    data: str = Field(min_length=1, description="The file's bytes in base64.", repr=False)
    format: MeshFormat = Field(description="What the file is: its ending.")
    units: LengthUnit | None = Field(default=None, description="Length unit; by default as its size shows.")
    up: UpAxis | None = Field(default=None, description="Up axis, which .obj, .ply and .stl cannot state.")


class Body(Table):
    """Who wears it: a mesh, or measures that a mannequin is made to have."""

    mesh: MeshFile | None = Field(default=None, description="A body as a mesh.")
    measures: BodyMeasures | None = Field(default=None, description="A person's measures [m].")

    @model_validator(mode="after")
    def _one(self) -> Body:
        if (self.mesh is None) == (self.measures is None):
            raise refusal("a body needs either mesh or measures", "give one of them")
        if self.measures is not None and not self.measures.model_dump(exclude_none=True):
            raise refusal("no measure is stated", "give stature, chest, waist or hip [m]", below="measures")
        return self


EXAMPLES: dict[str, Any] = {
    "a person's measures": {"product": "tshirt", "body": {"measures": {"chest": 1.02, "waist": 0.9}}},
    "a scan, with maps and meshes": {
        "product": "tshirt",
        "sizes": ["M", "L"],
        "body": {"mesh": {"data": "diAwIDAgMAo=", "format": "obj", "units": "cm"}},
        "fabric": "denim",
        "maps": ["gap", "pressure"],
        "glb": "garment",
    },
    "a garment of your own": {
        "garments": {"38": {"data": "diAwIDAgMAo=", "format": "obj"}},
        "fabric": "denim",
        "body": {"measures": {"stature": 1.7, "chest": 0.94}},
    },
}


class FitRequest(Table):
    """A body, and a product or a garment of your own."""

    model_config = ConfigDict(json_schema_extra={"examples": list(EXAMPLES.values())})

    product: Text | None = Field(default=None, description="A product's name (see /products).")
    garments: dict[Text, MeshFile] | None = Field(
        default=None,
        min_length=1,
        max_length=MOST_SIZES,
        description="Or a garment of your own: a mesh for each size, from small to large.",
    )
    body: Body
    sizes: tuple[Text, ...] | None = Field(
        default=None, min_length=1, max_length=MOST_SIZES, description="Sizes to fit; by default all."
    )
    fabric: Text | None = Field(
        default=None, description="Another of the product's fabrics (see /products), or a shipped one of your garment."
    )
    ease_cm: Real = Field(default=4.0, ge=-200, le=200, description="Wanted at chest, waist and hip [cm].")
    maps: tuple[Text, ...] = Field(default=(), max_length=16, description="Fit maps: strain, pressure, gap, or all.")
    glb: Contents = Field(default="none", description="Worn meshes as .glb: the garment alone, or on its body.")

    @model_validator(mode="after")
    def _one(self) -> FitRequest:
        if (self.product is None) == (self.garments is None):
            raise refusal("a request needs either product or garments", "give one of them")
        return self


class Problem(Table):
    """What is wrong with a fit."""

    code: str
    message: str
    remedy: str
    note: bool


class FitMap(Table):
    """A fit map."""

    unit: str
    range: tuple[float, float] = Field(description="Of the colours.")
    garments: dict[str, dict[str, float]] = Field(description="Percentiles, by garment.")
    values: dict[str, str] = Field(
        description="By garment: a value per vertex, in the order of the mesh, as little-endian float32 in base64."
    )


class SizeAnswer(Table):
    """One size on the body."""

    size: str
    status: str = Field(description="at_rest, iteration_limit, diverged or invalid.")
    worn: bool
    verdict: str = Field(description="In words: worn; worn, with notes; not worn.")
    message: str
    problems: tuple[Problem, ...]
    ease_cm: dict[str, float] = Field(description="At chest, waist and hip, where the garment goes round the trunk.")
    strain_p99: float | None
    rest_error_mm: float | None
    iterations: int | None
    digest: str | None = Field(description="Hash of the worn points' bits: equal for equal fits.")
    maps: dict[str, FitMap]
    glb: str | None = Field(description="The .glb file in base64.")


ANSWER: dict[str, Any] = {
    "product": "tshirt",
    "recommended": "M",
    "reason": "it leaves 6.1 cm at the hip, where it is closest; it is the smallest size.",
    "sizes": [
        {
            "size": "M",
            "status": "at_rest",
            "worn": True,
            "verdict": "worn",
            "message": "At rest after 3,200 iterations: forces balance to 0.062 %, and the shape is within 0.79 mm of "
            "its rest shape.",
            "problems": [],
            "ease_cm": {"chest": 6.335, "waist": 18.51, "hip": 6.089},
            "strain_p99": 0.0333,
            "rest_error_mm": 0.786,
            "iterations": 3200,
            "digest": "5e6516c3a7d062f93db626a0d307082d",
            "maps": {},
            "glb": None,
        }
    ],
    "seconds": 5.0,
}


class FitAnswer(Table):
    """Every size on the body, and which to take."""

    model_config = ConfigDict(json_schema_extra={"examples": [ANSWER]})

    product: str
    recommended: str | None
    reason: str
    sizes: tuple[SizeAnswer, ...]
    seconds: float = Field(description="Of work, for all requests that were fitted together.")


class Refusal(Table):
    """Why there is no answer."""

    error: str = Field(description="One line: place, problem, remedy.")


class Product(Table):
    """A product of this service."""

    name: str
    sizes: tuple[str, ...]
    fabrics: tuple[str, ...]


class Health(Table):
    """How the service is."""

    status: Literal["starting", "ok", "ending"]
    version: str
    device: str
    workers: int = Field(description="Processes that fit, alive now.")
    waiting: int = Field(description="Requests in the queue.")
    fitting: int = Field(description="Requests that are being fitted.")
    answered: int
    refused: int
    restarts: int = Field(description="Workers that have died, and were replaced.")


def openapi_models() -> dict[str, Any]:
    """The schemas of requests, for the OpenAPI page, by name."""
    schema = FitRequest.model_json_schema(ref_template="#/components/schemas/{model}")
    return {**schema.pop("$defs", {}), "FitRequest": schema}
