"""The first steps after init(), many times: what tracking does, in short lanes."""

from __future__ import annotations

from firmloop.verify.stimuli.characters.tracking import tracking
from firmloop.verify.stimuli.stimulus import Stimulus

STEPS = 8

STIMULUS = Stimulus("fresh starts", 8, 5, tracking, steps=STEPS, short_lanes=False)
