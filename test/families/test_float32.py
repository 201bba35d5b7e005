"""What is documented as float32 is that, under NumPy 2 and 1 alike: half the memory to move."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from ahf_ros.families.ring import reading
from ahf_ros.families.ring.likelihood import Evidence, normal
from support.scenes import identified, rendering

SINGLE = {'looks', 'typical', 'weight', 'dot', 'lit'}


def test_a_density_has_the_type_of_its_values() -> None:
    for kind in (np.float32, np.float64):
        values = np.linspace(-1, 1, 5, dtype=kind)
        assert normal(values, np.ones(5, kind)).dtype == kind


@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_evidence_is_of_single_precision(light: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Evidence] = []

    def noted(name: str) -> None:
        original = getattr(reading, name)

        def call(*values: Any, **options: Any) -> Evidence:
            found.append(original(*values, **options))
            return found[-1]

        monkeypatch.setattr(reading, name, call)

    noted('edge_evidence')
    noted('level_evidence')
    shown = rendering(width=500, height=400, targets=4, dot_radius=12.0, light=light, ambient=0.12)
    assert identified(shown.image)
    assert found
    for evidence in found:
        for field in fields(evidence):
            if field.name in SINGLE:
                assert getattr(evidence, field.name).dtype == np.float32, field.name
