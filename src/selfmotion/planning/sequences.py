"""Motions from the best sequences of configurations over all self-motions."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import NoSequenceError, Progress
from selfmotion.planning.draft import Draft
from selfmotion.planning.session import Session
from selfmotion.planning.settings import DEARER, DEARER_CHAIN
from selfmotion.problem import Problem
from selfmotion.search import SequenceGuide

_Searched = Callable[[Problem, np.random.Generator | int, Progress], list[SequenceGuide]]


def optimise_sequences(draft: Draft, searched: _Searched, *, chosen: bool) -> None:
    """Search, and optimise from the best sequences, one after another; note a search in vain.

    What is found is compared with what stands, and `chosen` only if it may be.
    """
    try:
        draft.sequences = searched(draft.problem, draft.search.rng, draft.progress)
    except NoSequenceError as error:
        draft.failure = error
        draft.notes.append(f"global search: {error}")
    begun: list[Session] = []
    for number, guide in enumerate(draft.sequences, 1):
        draft.progress("refining sequence", number, len(draft.sequences))
        session = draft.begin(guide.start, free=True, guide=guide)
        if session is None or (begun and _is_hopeless(draft, guide, session, begun[0])):
            continue
        session.take_chain(guide)
        if begun and begun[0].of_chain and not session.of_chain:
            continue
        draft.optimise(session, chosen=chosen)
        if draft.is_over:
            return
        begun = sorted([*begun, session], key=Session.score)
    if begun:
        draft.rival = begun[0]


def _is_hopeless(draft: Draft, guide: SequenceGuide, session: Session, best: Session) -> bool:
    """Whether a sequence is much dearer than the best, and costs more than what there is.

    Optimising gains some percent on a sequence.
    """
    if best.violations:
        return False
    least = draft.sequences[0].sequence.cost
    share = DEARER_CHAIN if best.of_chain else DEARER
    dearer = guide.sequence.cost > least + (share - 1.0) * abs(least)
    return dearer and session.merit() > best.score()[-1]
