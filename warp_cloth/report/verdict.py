"""The verdict on a fit, from its status and its problems: whether it is worn, and that in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from warp_cloth.loading.raw import counted
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.model.result import Status

if TYPE_CHECKING:
    from warp_cloth.solver.goal import Outcome

MOST_TOLD = 3  # problems in the verdict; the list has them all
OF_STATUS = (ProblemCode.DIVERGED, ProblemCode.NOT_AT_REST)  # say by themselves how the fit ended


def is_worn(status: Status, problems: Sequence[FitProblem]) -> bool:
    """Whether the garments are at rest, without a problem that is more than a note."""
    return status is Status.AT_REST and all(problem.code.is_note for problem in problems)


def verdict(outcome: Outcome, problems: Sequence[FitProblem]) -> str:
    """How a fit ended, then what is wrong and the remedy of what is the likeliest cause."""
    told = [problem for problem in problems if not problem.code.is_note] or list(problems)
    rest = f"At rest after {counted(outcome.iterations, 'iteration')}"
    if outcome.status is not Status.AT_REST:
        told.sort(key=lambda problem: problem.code not in OF_STATUS)  # how it ended, then why
        if not told:
            ended = outcome.status.value.replace("_", " ").capitalize()
            return f"{ended} after {counted(outcome.iterations, 'iteration')}."
    elif is_worn(outcome.status, problems):
        rest += (
            f": forces balance to {100 * outcome.check.residual.relative_rms:.2g} %, and the shape is within "
            f"{1e3 * outcome.check.rest_error:.2g} mm of its rest shape."
        )
        return " ".join([rest, *(f"Note: {problem.message} {problem.remedy}" for problem in told)])
    start = [f"{rest}, but not worn."] if outcome.status is Status.AT_REST else []
    return " ".join([*start, *_sentences(told), min(told, key=lambda problem: problem.code.rank).remedy])


def shape_verdict(problems: Sequence[FitProblem]) -> str:
    """The same of a shape of which only a fit would tell whether it is at rest."""
    told = [problem for problem in problems if not problem.code.is_note]
    if not told:
        return " ".join(["Worn, if it is at rest.", *(f"Note: {problem.message}" for problem in problems)])
    return " ".join(["Not worn.", *_sentences(told), told[0].remedy])


def _sentences(told: Sequence[FitProblem]) -> list[str]:
    """What the first of these problems say, and how many there are besides."""
    sentences = [problem.message for problem in told[:MOST_TOLD]]
    if len(told) > MOST_TOLD:
        sentences.append(f"{counted(len(told) - MOST_TOLD, 'more problem')} in the list.")
    return sentences
