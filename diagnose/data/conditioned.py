"""Do to recordings what a project asks for and a search can take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import Conditioning, check_conditioning, condition_input
from firmloop.identify.recordings.recording import Recording


def as_conditioned(
    plant: Plant, recordings: Sequence[Recording], conditioning: Conditioning
) -> tuple[tuple[Recording, ...], tuple[str, ...]]:
    """Do to the recordings what the project asks for and a search can take; return what it does not need, in words.

    An input loses its offset, as in a fit. Windows, smoothing and a coarser grid are ways to fit in noise of which the
    search has a model of its own. What would take a mismatch out of sight, or hide one in a clock, is refused.
    """
    where = "recordings.conditioning"
    inputs = [signal.name for signal in plant.inputs]
    for recording in recordings:
        check_conditioning(
            conditioning, (*inputs, *(signal.name for signal in plant.outputs)), recording.source, recording.time
        )
    offsets = [name for name in conditioning.remove_offset if name not in inputs]
    refused = (
        ("remove_offset", offsets, "an offset of a sensor is one of the effects that are looked for"),
        ("detrend", conditioning.detrend, "a trend is part of what physics does"),
        ("align", conditioning.align, "a late or skewed clock is one of the effects that are looked for"),
        ("line_Hz", conditioning.line_Hz, "the notch would take a part of the motion out"),
    )
    for key, value, why in refused:
        if value:
            shown = list(value) if isinstance(value, list | tuple) else value
            raise IdentifyError(
                f"{where}.{key} = {shown}: diagnose compares the outputs as they were recorded, because {why}; "
                "remove it, or record without the disturbance"
            )
    unused = [key for key in ("window_s", "savgol_window", "resample_s") if getattr(conditioning, key)]
    made = [
        replace(
            each,
            columns={
                name: condition_input(conditioning, name, values) if name in inputs else values
                for name, values in each.columns.items()
            },
        )
        for each in recordings
    ]
    notes = [f"{where}.{', '.join(unused)} not used: the search has a noise model of its own"] if unused else []
    return tuple(made), tuple(notes)
