"""How a batch's items are split into shards."""

from __future__ import annotations

from warp_cloth.batch.jobs import Item
from warp_cloth.batch.store import split


def met_by(*avatars: str) -> list[Item]:
    return [Item(f"i{at}", "tshirt", (f"avatar.shape.stature={each}",)) for at, each in enumerate(avatars)]


def test_items_of_one_avatar_stay_together() -> None:
    shards = split(met_by("1.6", "1.7", "1.6", "1.7", "1.6", "1.7"), 3)
    assert [shard.places for shard in shards] == [(0, 2, 4), (1, 3, 5)]
    assert [item.name for item in shards[1].items] == ["i1", "i3", "i5"]


def test_a_shard_is_larger_rather_than_that_an_avatar_is_met_in_two() -> None:
    assert [len(shard.items) for shard in split(met_by(*["1.6"] * 5, *["1.7"] * 4), 4)] == [5, 4]
    assert [len(shard.items) for shard in split(met_by(*["1.6"] * 11), 4)] == [4, 4, 3]


def test_few_items_of_several_avatars_fill_a_shard() -> None:
    assert [shard.places for shard in split(met_by("1.6", "1.7", "1.8", "1.6"), 3)] == [(0, 3, 1), (2,)]


def test_what_is_not_the_avatars_mesh_leaves_the_order() -> None:
    items = [Item(f"i{at}", "tshirt", (f"avatar.friction={at % 2}",)) for at in range(4)]
    assert [shard.places for shard in split(items, 2)] == [(0, 1), (2, 3)]


def test_large_shards_are_small_at_first_and_at_last() -> None:
    def sizes(count: int, size: int) -> list[int]:
        shards = split(met_by(*(f"1.{at // 1024}" for at in range(count))), size)
        assert sorted(place for shard in shards for place in shard.places) == list(range(count))
        return [len(shard.items) for shard in shards]

    assert sizes(1024, 256) == [128, 204, 308, 256, 128]
    assert sizes(4096, 1024) == [128, 204, 326, 521, 997, 1024, 512, 256, 128]
    assert sizes(210, 70) == [35, 56, 84, 35]
    assert sizes(70, 70) == [35, 35]
    assert sizes(15, 70) == [15]
    for count in range(64, 3000, 37):
        assert max(sizes(count, 64 + count // 9)) <= 1.25 * (64 + count // 9)


def test_large_shards_have_some_garments_in_all_fabrics_and_halves_every_other_one() -> None:
    asked = [(fabric, size) for fabric in range(16) for size in "ABCD"]
    changes = [(f"garment.shape.size={size}", f"garment.fabric.weight=0.{fabric + 1}") for fabric, size in asked]
    items = [Item(f"i{at}", "tshirt", change) for at, change in enumerate(changes)]
    halves = [{"ABCD"[place % 4] for place in shard.places} for shard in split(items, 64)]
    assert halves == [{"A", "C"}, {"B", "D"}]


def test_the_first_garments_come_on_the_first_few_avatars_before_others_come() -> None:
    asked = [(avatar, size) for avatar in range(6) for size in "ABCD" for _ in range(16)]
    changes = [(f"avatar.shape.stature=1.{avatar}", f"garment.shape.size={size}") for avatar, size in asked]
    shards = split([Item(f"i{at}", "tshirt", change) for at, change in enumerate(changes)], 64)
    order = list(dict.fromkeys(asked[place] for shard in shards for place in shard.places))
    assert order[:8] == [(avatar, size) for avatar in range(4) for size in "AC"]
    assert order[8:16] == [(avatar, size) for avatar in (3, 2, 1, 0) for size in "BD"]
    assert order[16:] == [(avatar, size) for avatar in (4, 5) for size in "ACBD"]
