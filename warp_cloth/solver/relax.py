"""The relax loop: force, cap, displacement, contact, again and again (the paper, section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.collector import no_collection
from warp_cloth.kernels.base.options import KernelOptions
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.passes.advance import advance_kernel, fuses_contact
from warp_cloth.kernels.passes.move import displace_kernel
from warp_cloth.kernels.passes.move_packets import packet_displace_kernel
from warp_cloth.kernels.passes.step import NoClothContact, NoCollider, accumulated, saves_queries
from warp_cloth.model.model import ClothModel
from warp_cloth.model.vertices import allocate_steps
from warp_cloth.solver.active_set import ActiveSet
from warp_cloth.solver.anisotropic_step import AnisotropicStep
from warp_cloth.solver.forces import ForcePass, in_patches, pass_size, takes_packets
from warp_cloth.solver.packed import PackedCloth
from warp_cloth.solver.parallel_domains import ParallelDomains
from warp_cloth.solver.step_options import StepOptions, build_step

if TYPE_CHECKING:
    from warp_cloth.contact.cloth import ClothContact

LIMIT_ON_CLOTH = 30.0  # where cloth meets cloth there is no more of it, nor the even damping of other loose cloth
# Once forces have been balanced for SWUNG iterations there is less of it for as many, then as much again, and so on.
# Long steps can feed cloth that leaves the avatar and touches it again: of 8 T-shirts that took longer, two never came
# to rest (they swung by up to 0.7 mm), and all do with less. Other cloth needs them to balance to the last per cent.
SWUNG, LIMIT_WHEN_SWUNG = 4000, 10.0
TIGHTER = 4.0  # times ``loose``: what is loose stays so till then, and does not change to and fro


class Relaxation:
    """Owns the scratch memory of a model's iterations and runs them in captured bursts.

    ``colliders`` are those of the items, all of one kind; ``caps`` their largest displacements [m], by default that
    of the options. ``cloth_contact`` is the contact of cloth with cloth; None: it passes through itself.
    """

    def __init__(
        self,
        model: ClothModel,
        colliders: Collider | Sequence[Collider],
        options: StepOptions,
        cloth_contact: ClothContact | None = None,
        caps: Sequence[float | None] | None = None,
    ) -> None:
        self.model, self.cloth_contact = model, cloth_contact
        of_items = [colliders] * model.item_count if isinstance(colliders, Collider) else list(colliders)
        self._colliders = of_items  # keeps the arrays that ``collider_data`` refers to
        self.avatar_contact, self.collider_type = of_items[0].avatar_contact, of_items[0].data_type or NoCollider
        self.step = build_step(options, model.precision)
        self._anisotropy_limit, self._loose, self._renewal = options.anisotropy_limit, options.loose, options.renewal
        if cloth_contact is not None:  # else folds that lie on cloth swing for ever
            self.step.buckling = 1.0
            self._anisotropy_limit = min(options.anisotropy_limit, LIMIT_ON_CLOTH)
        kernel_options = self._chosen_kernels(accelerated=options.method == "accelerated")
        self._kernel_options = kernel_options
        has_compliance = kernel_options.anisotropic and options.anisotropy_limit > 0.0
        allocate_steps(
            model.state,
            model.precision,
            stiffness=kernel_options.accelerated,
            compliance=has_compliance,
            in_contact=kernel_options.anisotropic,
            clearance=saves_queries(kernel_options),
        )
        self.active_set = ActiveSet(model)
        self._anisotropic_step = self._new_anisotropic_step() if has_compliance else None
        self._scatter: ForcePass | None = None
        self._packed: PackedCloth | None = None
        self._packets = kernel_options.packets
        self._fuses_contact = fuses_contact(kernel_options) and model.patches is not None
        if model.patches is not None:  # no sum of forces in memory, but a second set of positions to write to
            self._move = in_patches(advance_kernel(kernel_options), model.patches.paired)
            packed = cloth_contact is None
            some = self.active_set.vertices
            self._packed = PackedCloth(model, model.patches, kernel_options.accelerated, some, packed=packed)
        else:
            self._same_order = wp.empty(0, dtype=wp.int32, device=model.device)
            self._load = wp.zeros(model.vertex_count, dtype=cloth_types(model.precision).vec4, device=model.device)
            self._scatter = ForcePass(model, kernel_options.accumulate, self._load)
            self._move = (packet_displace_kernel if self._packets else displace_kernel)(kernel_options)
        self._items = model.vertices.items.numpy().copy()
        self._items["active"] = 1
        self._items["cap"] = [options.largest_move if cap is None else cap for cap in caps or [None] * model.item_count]
        self._sizes = np.diff(model.item_start)  # of the items, in vertices
        self._balanced_at = np.zeros(model.item_count, dtype=np.int64)  # iteration at which forces came to balance
        self.collider_data: Any = NoCollider()
        if self.avatar_contact is not None:
            data = [collider.data for collider in of_items]
            self.collider_data = wp.array(data, dtype=self.collider_type, device=model.device)
        self._done = 0  # iterations since the start
        self.drop_graphs()
        self.upload_items()
        self._together = self._shared_out(options.threads)

    def _chosen_kernels(self, *, accelerated: bool) -> KernelOptions:
        """What the kernels of an iteration are compiled for."""
        model, patches = self.model, self.model.patches
        options = KernelOptions(
            precision=model.precision,
            terms=model.terms,
            accelerated=accelerated,
            avatar_contact=self.avatar_contact,
            collider=self.collider_type,
            cloth_contact=self.cloth_contact is not None,
            fits=patches is not None and patches.fits,
            few=patches is not None and patches.few,
            paired=patches is not None and patches.paired,
            packets=accelerated and patches is None and takes_packets(model, model.vertex_count),
        )
        return replace(options, accumulate=accumulated(options))

    def _new_anisotropic_step(self) -> AnisotropicStep:
        """What updates vertices' compliance, in the order in which patches own them."""
        permutation = None if self.model.patches is None else self.model.patches.permutation
        packed = permutation is not None and self.cloth_contact is None
        return AnisotropicStep(self.model, permutation, packed=packed, active_set=self.active_set)

    def contact_state(self) -> Any:
        """The State now, with vertices numbered as contact of cloth with cloth has them."""
        return self.model.state if self._packed is None else self._packed.pack()

    def _shared_out(self, count: int) -> ParallelDomains | None:
        """What lets so many threads iterate; None: what is to be iterated cannot be shared out."""
        if count <= 1 or not self._packets or self.model.item_count > 1:
            return None

        def add_contact(iteration: int) -> None:
            self._add_contact_forces(iteration, self.model.state)

        contact = None if self.cloth_contact is None else add_contact
        summed = self._kernel_options.accumulate
        return ParallelDomains(self.model, count, summed, self._move, self._anisotropic_step, contact)

    @property
    def thread_count(self) -> int:
        """How many threads of the host iterate."""
        return 1 if self._together is None else self._together.count

    def set_momentum(self, momentum: float) -> None:
        """Changes the momentum of all iterations from now on."""
        self.step.momentum = momentum
        self.drop_graphs()

    def set_collider(self, item: int, collider: Collider) -> None:
        """Replaces an item's collider by another one of the same kind."""
        self.model.forget_clearance(item)
        self._colliders[item] = collider
        if self.avatar_contact is not None:
            data = wp.array([collider.data], dtype=self.collider_type, device=self.model.device)
            wp.copy(self.collider_data, data, dest_offset=item, count=1)

    def update_anisotropy(self, relative_rms: NDArray[np.float64]) -> None:
        """Lets worn items whose forces have balanced take anisotropic steps, others not; settles contact of cloth, too.

        Call it after a check of all items, as many iterations later on every device.

        Args:
            relative_rms: of the items' residuals, shape [items].
        """
        cloth_contact = self.cloth_contact
        if cloth_contact is not None and cloth_contact.settle(
            balanced=bool(self._balanced(relative_rms, cloth_contact.settled).all())
        ):
            self.drop_graphs()
        if self._anisotropic_step is None:
            return
        before = self._items["anisotropy_limit"].copy()
        balanced = self._balanced(relative_rms, before > 0.0)
        now = np.where(balanced, self._limits(before > 0.0), 0.0).astype(before.dtype)
        if (now == before).all():
            return
        self._anisotropic_step.forget(np.flatnonzero(now != before).tolist())
        if (now > 0.0).any() != (before > 0.0).any():
            self.drop_graphs()
        self._items["anisotropy_limit"] = now
        self.upload_items()

    def _limits(self, before: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Limits of the items' anisotropic steps, should they be balanced; which were so ``before``."""
        self._balanced_at[~before] = self._done
        limits = np.full(len(before), self._anisotropy_limit)
        if self.cloth_contact is not None:
            is_less = (self._done - self._balanced_at) // SWUNG % 2 == 1
            limits[is_less] = min(self._anisotropy_limit, LIMIT_WHEN_SWUNG)
        return limits

    def _balanced(self, relative_rms: NDArray[np.float64], before: NDArray[np.bool_] | bool) -> NDArray[np.bool_]:
        """Which residuals mean that forces balance; those that did ``before`` do so up to a larger one."""
        return np.asarray(relative_rms <= np.where(before, TIGHTER * self._loose, self._loose))

    def restart(self) -> None:
        """Lets every item iterate, from the first iteration on, from where the model has it."""
        self._done = 0
        if self._packed is not None:
            self._packed.ahead = False
        self.update_anisotropy(np.full(self.model.item_count, np.inf))
        self._items["active"] = 1
        self.upload_items()
        for item in range(self.model.item_count):
            self.model.forget_clearance(item)
        self._choose_patches()

    @property
    def runs_long(self) -> bool:
        """Whether a long burst takes less than several short ones, as vertices are packed, and changes nothing else."""
        return self._packed is not None and self.avatar_contact is None and self.cloth_contact is None

    @property
    def active_fraction(self) -> float:
        """Share of the vertices whose items iterate."""
        return float(self._sizes[self._items["active"] == 1].sum() / self._sizes.sum())

    def deactivate(self, items: Sequence[int]) -> None:
        """Leaves these items as they are from now on."""
        if not len(items):
            return
        self._items["active"][list(items)] = 0
        self.upload_items()
        self._choose_patches()

    def _choose_patches(self) -> None:
        """Works on no more than the items that iterate."""
        patches = self.model.patches
        if patches is not None and patches.work_on(self._items["active"] == 1):
            self.active_set.choose(self._items["active"] == 1)
            self.drop_graphs()

    def drop_graphs(self) -> None:
        """Captures iterations anew: what they read or launch has changed."""
        self._graphs: dict[tuple[int, int, bool], Any] = {}
        self._shares_graphs: dict[tuple[int, int], list[Any]] = {}  # of each share, where threads share iterations

    def upload_items(self) -> None:
        """Puts what the items have of their own on the device."""
        self.model.vertices.items.assign(self._items)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that an iteration launches, in order."""
        touching = [] if self.cloth_contact is None else self.cloth_contact.kernels()
        scattering = [] if self._scatter is None else self._scatter.kernels()
        moving = [self._move] if self._packed is None else self._packed.kernels(self._move)
        sharing = [] if self._together is None else self._together.kernels()
        return [*scattering, *touching, *moving, *sharing]

    @property
    def slowest_to_compile(self) -> wp.Kernel:
        """The kernel whose compiling should begin first."""
        return self._move

    def seldom_kernels(self) -> list[wp.Kernel]:
        """The kernels that some iterations of loose cloth launch besides; they must be loaded, too."""
        return [] if self._anisotropic_step is None else self._anisotropic_step.kernels()

    @property
    def contact_data(self) -> Any:
        """What the kernels read of cloth on cloth."""
        return NoClothContact() if self.cloth_contact is None else self.cloth_contact.data

    def _add_contact_forces(self, iteration: int, state: Any) -> None:
        """Contact of cloth with cloth, where there is any."""
        if self.cloth_contact is not None and self.cloth_contact.awake:
            if iteration % self.cloth_contact.check_interval == 0:
                self.cloth_contact.search_where_due(state)
            if not self._fuses_contact:
                self.cloth_contact.add_forces(self.step, state)

    def _update_compliance(self, state: Any) -> None:
        """Where it is due by the iterations since the start, whatever bursts they are run in."""
        if (
            self._anisotropic_step is not None
            and self._items["anisotropy_limit"].any()
            and self._done % self._renewal == 0
        ):
            vertices = self.model.vertices if self._packed is None else self._packed.vertices
            self._anisotropic_step.update(vertices, state, self.step)
        self._done += 1

    def iterate(self, count: int = 1) -> None:
        """Launches iterations."""
        if self._packed is not None and self.stays_packed:
            self._packed.iterate(self._move, self._arguments, count, self._before_move)
        else:
            self._iterate(count)

    @property
    def _arguments(self) -> list[Any]:
        """Arguments of the kernel that moves vertices, besides the cloth."""
        return [self.step, self.collider_data, self.contact_data]

    @property
    def stays_packed(self) -> bool:
        """Whether the cloth stays as patches own it from graph to graph: where others read it between iterations."""
        return self._packed is not None and (self.cloth_contact is not None or self._anisotropic_step is not None)

    def _iterate(self, count: int) -> None:
        """Launches what a graph of iterations holds."""
        model, here = self.model, self.model.state
        own = self._arguments
        if self._scatter is not None:
            for iteration in range(count):
                self._update_compliance(here)
                self._scatter.launch(self.step)
                self._add_contact_forces(iteration, here)
                order = [self._same_order] if self._packets else []
                inputs = [model.vertices, here, *own, *order, self._load]
                size = pass_size(model.vertex_count, self._packets)
                wp.launch(self._move, dim=size, inputs=inputs, device=model.device)
        if self._packed is not None and self.stays_packed:
            self._packed.iterate_packed(self._move, own, count, self._before_move)
        elif self._packed is not None:
            self._packed.iterate(self._move, own, count, None)
            self._done += count

    def _before_move(self, iteration: int, state: Any) -> int:
        """Compliance, and contact of cloth with cloth, before an iteration; how many blocks are to press meanwhile."""
        self._update_compliance(state)
        self._add_contact_forces(iteration, state)
        if self.cloth_contact is None or self.model.patches is None or not self._fuses_contact:
            return 0
        return self.cloth_contact.divide_blocks(self.model.patches.count)

    def run(self, iterations: int, *, shown: bool = True) -> None:
        """Runs a burst of iterations as one captured graph, without waiting for the device.

        The kernels must be loaded: capture records launches only. ``shown``: whether the model is to know where the
        cloth is then; else nothing may ask it but after ``update_model``, and nothing move it but more iterations.
        """
        together = self._together
        if self._packed is not None and self.stays_packed:
            graph, whole = self.capture(iterations, shown=shown), self._whole(shown)
            if not whole:
                self._packed.pack()
            wp.capture_launch(graph)
            self._done += iterations
            self._packed.ahead = not shown and iterations % 2 == 0
            if not whole and not self._packed.ahead:
                self._packed.unpack(iterations)
            return
        if together is None or not together.pays():
            wp.capture_launch(self.capture(iterations))
            self._done += iterations
            return
        while iterations > 0:
            part = min(iterations, self._renewal - self._done % self._renewal) if together.updates_first else iterations
            together.run(self._captured_shares(together, part))
            self._done += part
            iterations -= part

    def update_model(self) -> None:
        """Writes the cloth to the model's State, after bursts that were not ``shown``."""
        if self._packed is not None and self._packed.ahead:
            self._packed.unpack()

    def _captured_shares(self, together: ParallelDomains, iterations: int) -> list[Any]:
        """The graphs of the next burst's shares."""
        which = iterations, self._done % self._renewal
        if which not in self._shares_graphs:
            loose = bool(self._items["anisotropy_limit"].any())
            updates = [loose and (self._done + number) % self._renewal == 0 for number in range(iterations)]
            self._shares_graphs[which] = together.capture(self._arguments, updates)
        return self._shares_graphs[which]

    def _whole(self, shown: bool) -> bool:
        """Whether the next burst's graph begins and ends where the model has the cloth."""
        return shown and not (self._packed is not None and self._packed.ahead)

    def capture(self, iterations: int, *, shown: bool = True) -> Any:
        """The graph of the next burst, which ``run`` would capture now if it had not been captured before."""
        done, whole = self._done, self._whole(shown)
        which = iterations, done % self._renewal, whole
        if which not in self._graphs:
            with no_collection(), wp.ScopedCapture(device=self.model.device) as capture:
                if whole:
                    self.iterate(iterations)
                else:
                    self._iterate(iterations)
            self._graphs[which], self._done = capture.graph, done
        return self._graphs[which]
