"""Of what the figures are: which network, and when."""

from __future__ import annotations

from datetime import UTC, datetime

from service.flight_evaluation.evaluation import Evaluation
from service.flight_evaluation.sight import DepthKind
from service.network import load_network


def today() -> str:
    """Date of the run."""
    return datetime.now(UTC).date().isoformat()


def model_name(evaluation: Evaluation) -> str:
    """The network by its card, the day it was made and what ran it; "true depth" where none was flown."""
    if DepthKind.NETWORK not in evaluation.plan.kinds:
        return "true depth"
    model = load_network(evaluation.settings)
    card = model.card
    hints = f", hints {' and '.join(card.hints)}" if card.hints else ", no hints"
    return f"{card.name} of {card.created}{hints}, on {model.provider} in {model.precision}"
