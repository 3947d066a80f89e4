"""How a batch's items are cut into shards."""

from __future__ import annotations

from warp_cloth.batch.jobs import Item
from warp_cloth.batch.pool import alike
from warp_cloth.batch.store import cut


def met_by(*avatars: str) -> list[Item]:
    return [Item(f"i{at}", "tshirt", (f"avatar.shape.stature={each}",)) for at, each in enumerate(avatars)]


def test_items_of_one_avatar_stay_together() -> None:
    shards = cut(met_by("1.6", "1.7", "1.6", "1.7", "1.6", "1.7"), 3)
    assert [shard.places for shard in shards] == [(0, 2, 4), (1, 3, 5)]
    assert [item.name for item in shards[1].items] == ["i1", "i3", "i5"]


def test_a_shard_is_larger_rather_than_that_an_avatar_is_met_in_two() -> None:
    assert [len(shard.items) for shard in cut(met_by(*["1.6"] * 5, *["1.7"] * 4), 4)] == [5, 4]
    assert [len(shard.items) for shard in cut(met_by(*["1.6"] * 11), 4)] == [4, 4, 3]


def test_few_items_of_several_avatars_fill_a_shard() -> None:
    assert [shard.places for shard in cut(met_by("1.6", "1.7", "1.8", "1.6"), 3)] == [(0, 3, 1), (2,)]


def test_what_is_not_the_avatars_mesh_leaves_the_order() -> None:
    items = [Item(f"i{at}", "tshirt", (f"avatar.friction={at % 2}",)) for at in range(4)]
    assert [shard.places for shard in cut(items, 2)] == [(0, 1), (2, 3)]


def test_a_large_batch_begins_and_ends_with_small_shards() -> None:
    sizes = [len(shard.items) for shard in cut(met_by(*["1.6"] * 1024, *["1.7"] * 1024, *["1.8"] * 1024), 1024)]
    assert sizes == [128, 256, 640, 1024, 640, 256, 128]
    assert [len(shard.items) for shard in cut(met_by(*["1.6"] * 1024), 256)] == [128, 128, 256, 256, 128, 128]
    assert alike(sizes) == [0, 6]
    assert alike(sizes[1:]) == [0, 4], "small ones wait till the large ones are done"
    assert alike(sizes[2:]) == [0, 1, 2]


def test_the_first_and_the_last_of_large_shards_are_halved() -> None:
    bodies = ["1.6"] * 70 + ["1.7"] * 70 + ["1.8"] * 70
    assert [len(shard.items) for shard in cut(met_by(*bodies), 70)] == [35, 35, 70, 35, 35]
    assert [len(shard.items) for shard in cut(met_by(*bodies[:70]), 70)] == [35, 35]
    assert [len(shard.items) for shard in cut(met_by(*bodies[:63]), 70)] == [63]


def test_large_shards_have_some_garments_in_all_fabrics_and_halves_every_other_one() -> None:
    asked = [(fabric, size) for fabric in range(16) for size in "ABCD"]
    changes = [(f"garment.shape.size={size}", f"garment.fabric.weight=0.{fabric + 1}") for fabric, size in asked]
    items = [Item(f"i{at}", "tshirt", change) for at, change in enumerate(changes)]
    halves = [{"ABCD"[place % 4] for place in shard.places} for shard in cut(items, 64)]
    assert halves == [{"A", "C"}, {"B", "D"}]
