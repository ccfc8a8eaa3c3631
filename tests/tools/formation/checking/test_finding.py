"""Findings are numbers: their sentences follow from them, also after renumbering or storing."""

import json
import re

import numpy as np
import pytest
from formup.tools.formation.checking.check import certify
from formup.tools.formation.checking.finding import REMEDIES, SENTENCES, Finding
from formup.tools.formation.checking.verdict import Audit, Verdict
from formup.tools.formation.contract import Contract, Group, with_defaults
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline

SITE = Site({"t1": make_outline([(120, 100), (260, 100), (260, 190), (120, 190)])}, 400, 300, 0.05)
POINTS = np.array([[60, 50], [190, 60], [330, 60], [320, 200], [150, 150], [395, 298], [40, 160.0]])


def verdict(points: np.ndarray, relation: str = "around") -> Verdict:
    group = Group.model_validate({"relation": relation, "targets": ["t1"], "robots": len(points)})
    return certify(points, with_defaults(Contract(groups=(group,)), SITE.outlines, SITE.room), SITE)


def test_a_verdict_is_read_back_as_it_was_with_its_sentences_written_out() -> None:
    made = verdict(POINTS)
    text = made.model_dump_json()
    assert Verdict.model_validate_json(text) == made
    assert Verdict.model_validate_json(text).model_dump_json() == text
    first = json.loads(text)["findings"][0]
    assert first["sentence"] == made.findings[0].sentence
    assert {"kind", "robot", "value", "limit", "unit"} <= set(first)


def test_lengths_are_in_metres_too_where_the_scale_is_known() -> None:
    audits = [Audit(), Audit(0.05)]
    for audit in audits:
        audit.find("too_close", 12.34, 20, robot=2, others=(6,))
    plain, metric = (audit.findings[0].sentence for audit in audits)
    assert plain == "Robot 3 is 12.3 px from robot 7; 20.0 px or more are needed."
    assert metric == (
        "Robot 3 is 0.615 m (12.3 px) from robot 7; 1.000 m (20.0 px) or more are needed."
    )


@pytest.mark.parametrize("kind", sorted(SENTENCES))
@pytest.mark.parametrize("needed", [None, 9])
def test_every_kind_has_a_sentence_that_its_numbers_fill(kind: str, needed: int | None) -> None:
    found = Finding(
        kind=kind, robot=3, others=(7, 5), about="t1", value=1.5, limit=2, needed=needed
    )
    assert re.fullmatch(r"[^{}]+\.", found.sentence)
    assert ("9 robots" in found.sentence) == (needed is not None and kind in REMEDIES)
    if "{others}" in SENTENCES[kind]:
        assert "robot 5 and 7" in found.sentence
