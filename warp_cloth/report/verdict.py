"""The verdict on a fit, from its status and its problems: whether it is worn, and that in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from warp_cloth.loading.raw import counted
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.model.result import Status

if TYPE_CHECKING:
    from warp_cloth.solver.goal import Outcome

MOST_SHOWN = 3  # problems in the verdict; the list has them all
OF_STATUS = (ProblemCode.DIVERGED, ProblemCode.NOT_AT_REST)  # say by themselves how the fit ended


def is_worn(status: Status, problems: Sequence[FitProblem]) -> bool:
    """Whether the garments are at rest, without a problem that is more than a note."""
    return status is Status.AT_REST and all(problem.code.is_note for problem in problems)


def verdict(outcome: Outcome, problems: Sequence[FitProblem]) -> str:
    """How a fit ended, then what is wrong and the remedy of what is the likeliest cause."""
    reported = [problem for problem in problems if not problem.code.is_note] or list(problems)
    rest = f"At rest after {counted(outcome.iterations, 'iteration')}"
    if outcome.status is not Status.AT_REST:
        reported.sort(key=lambda problem: problem.code not in OF_STATUS)  # how it ended, then why
        if not reported:
            ended = outcome.status.value.replace("_", " ").capitalize()
            return f"{ended} after {counted(outcome.iterations, 'iteration')}."
    elif is_worn(outcome.status, problems):
        rest += (
            f": forces balance to {100 * outcome.check.residual.relative_rms:.2g} %, and the shape is within "
            f"{1e3 * outcome.check.rest_error:.2g} mm of its rest shape."
        )
        return " ".join([rest, *(f"Note: {problem.message} {problem.remedy}" for problem in reported)])
    start = [f"{rest}, but not worn."] if outcome.status is Status.AT_REST else []
    return " ".join([*start, *_sentences(reported), min(reported, key=lambda problem: problem.code.rank).remedy])


def shape_verdict(problems: Sequence[FitProblem]) -> str:
    """The verdict on a shape that was not relaxed, so that nobody knows whether it is at rest."""
    reported = [problem for problem in problems if not problem.code.is_note]
    if not reported:
        return " ".join(["Worn, if it is at rest.", *(f"Note: {problem.message}" for problem in problems)])
    return " ".join(["Not worn.", *_sentences(reported), reported[0].remedy])


def _sentences(reported: Sequence[FitProblem]) -> list[str]:
    """The messages of the first of these problems, and how many more there are."""
    sentences = [problem.message for problem in reported[:MOST_SHOWN]]
    if len(reported) > MOST_SHOWN:
        sentences.append(f"{counted(len(reported) - MOST_SHOWN, 'more problem')} in the list.")
    return sentences
