"""A Search: what was found, what it was chosen against, and which other explanations stand beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from firmloop.diagnose.model.candidate import Candidate, closer, contain, likely, worth_their_price
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem
from firmloop.diagnose.policy import LEVELLED, LEVELLED_WITHIN
from firmloop.diagnose.search.exchange import amounts_to
from firmloop.diagnose.search.screen import Screened
from firmloop.identify.plants.plant import Plant

Progress = Callable[[float, str], None]
Hypothesis = frozenset[str]  # terms by their labels


def beside(base: Candidate, terms: Sequence[Screened]) -> frozenset[Hypothesis]:
    """Return the hypotheses of a candidate's terms with one more each."""
    labels = [term.label for term in base.fitted.terms]
    return frozenset(frozenset((*labels, each.term.label)) for each in terms)


@dataclass(frozen=True, slots=True)
class Search:
    """What the search found: the nominal refit, the best explanation, and what it was chosen against, by round.

    The nominal refit is the one that simulates nearest, with the score of what the first effect was held against.
    """

    problem: Problem
    nominal: Candidate
    best: Candidate
    rounds: tuple[tuple[Candidate, ...], ...]  # best first
    screened: tuple[Screened, ...]  # of the first round
    gains: tuple[float, ...]  # drop of BIC by each accepted effect, in the order found
    refit: Plant | None = None  # what `identify` makes of the train recordings
    barren: frozenset[Hypothesis] = frozenset()  # what was tried and brought nothing


def candidates_of(search: Search) -> tuple[Candidate, ...]:
    """Return other explanations with as many effects; one that only contains or is contained is no candidate."""
    return _one_each(_no_relatives(search))


def near_best(search: Search, within: float = LEVELLED_WITHIN) -> dict[frozenset[LibraryTerm], Candidate]:
    """Return what is hardly told from the best, the likeliest first."""
    near = [each for each in candidates_of(search) if each.score - search.best.score < within]
    return {frozenset(each.fitted.terms): each for each in near[:LEVELLED]}


def richer_of(search: Search) -> tuple[Candidate, ...]:
    """Return the explanations with as many effects that have the best as a special case."""
    return _one_each([candidate for candidate, theirs, ours in _others(search) if contain(theirs, ours)])


def _no_relatives(search: Search) -> list[Candidate]:
    return [each for each, theirs, ours in _others(search) if not (contain(theirs, ours) or contain(ours, theirs))]


def _one_each(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return the first of each hypothesis: one that was fitted from several starts is as probable as any other."""
    found: dict[frozenset[LibraryTerm], Candidate] = {}
    for each in candidates:
        found.setdefault(frozenset(each.fitted.terms), each)
    return tuple(found.values())


def _others(search: Search) -> list[tuple[Candidate, set[str], set[str]]]:
    """Return the explanations with as many effects, best first, with what only they have and what only the best has.

    Not those that amount to a simpler one.
    """
    mine = search.best.fitted
    every = sorted((each for turn in search.rounds for each in turn), key=lambda each: each.score)
    return [
        (each, set(each.fitted.names) - set(mine.names), set(mine.names) - set(each.fitted.names))
        for each in every
        if len(each.fitted.terms) == len(mine.terms)
        and set(each.fitted.terms) != set(mine.terms)
        and not any(amounts_to(each.fitted, term) for term in each.fitted.terms)
    ]


def as_near(search: Search, other: Candidate) -> bool:
    """Tell whether simulations of another explanation are not far farther off than those of the best, as it was tried.

    What is written of the best may have other values: those of plain simulation error.
    """
    terms = set(search.best.fitted.terms)
    same = [each for turn in search.rounds for each in turn if set(each.fitted.terms) == terms]
    mine = min(same, key=lambda each: each.score, default=search.best)
    return closer(other, mine) or not closer(mine, other)


def standing(search: Search) -> tuple[Candidate, ...]:
    """Return other explanations with as many effects that simulate about as near as the best."""
    near = [each for each in _no_relatives(search) if as_near(search, each) and likely(each.fitted)]
    return _one_each([each for each in worth_their_price([search.best, *near]) if each is not search.best])
