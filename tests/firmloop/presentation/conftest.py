"""C that is wrong, for the reports that have to say so."""

from __future__ import annotations

import pytest

from firmloop.stages import making


@pytest.fixture
def wrong_output(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every generated C answer one more than it should."""
    sound = making.emit

    def planted(*given: object) -> object:
        bundle = sound(*given)  # type: ignore[arg-type]
        name = bundle.sources[0]
        text = bundle.files[name].replace("out->output = ", "out->output = 1 + ", 1)
        assert text != bundle.files[name]
        return type(bundle)(
            **{each: getattr(bundle, each) for each in type(bundle).__slots__} | {"files": {**bundle.files, name: text}}
        )

    monkeypatch.setattr(making, "emit", planted)
