"""Say how the parameters of one sample enter the prediction of a predictive controller.

The parameters, in order: the state when the output will act; the last output, where its changes are limited; the
estimated disturbances at the inputs; then of the reference and of each known disturbance the samples that the horizon
sees. Both are given `preview` samples before they are due, and the last one given is held to the end.

The targets of a sample are the rest that belongs to what is due in it: x = A x + B u + E d with the first output C x at
the reference, at 0 where there is none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from firmloop.design.design import Request
from firmloop.design.kinds.mpc.read import MpcSetup, blocks_of
from firmloop.design.law import DesignError
from firmloop.design.models.model import Model, weights
from firmloop.design.models.regulator import terminal_weight
from firmloop.design.quadratic.condense import Prediction

Array = npt.NDArray[np.float64]

FARTHEST = 1e15  # one weight from another


def seen_samples(setup: MpcSetup, place: int) -> tuple[int, ...]:
    """Return which samples of input `place` the horizon sees, counted from the one that is due."""
    return tuple(sorted(set(_order(setup, place))))


def prediction_of(request: Request, setup: MpcSetup) -> Prediction:
    """Read the weights and put the prediction together."""
    table, model = request.table, setup.model
    n, m = model.b.shape
    q = np.zeros((n, n))
    q[: model.order, : model.order] = weights(table, "Q", model.order, False)
    r = weights(table, "R", m, True)
    _check_weights(q, r)
    p = weights(table, "P", n, False) if "P" in table else terminal_weight(model.a, model.b, q, r)
    blocks = blocks_of(table, setup.horizon)
    sizes = [n, m if setup.rated else 0, m if setup.disturbed else 0]
    sizes += [len(seen_samples(setup, place)) for place in setup.told]
    edges = np.concatenate([[0], np.cumsum(sizes)])
    columns = [np.eye(edges[-1])[edges[k] : edges[k + 1]] for k in range(len(sizes))]
    none = np.zeros((m, edges[-1]))
    last = columns[1] if setup.rated else none
    disturbance = columns[2] if setup.disturbed else none
    drift = np.tile(model.b @ disturbance, (setup.horizon, 1, 1))
    x_target = np.zeros((setup.horizon, n, edges[-1]))
    u_target = np.tile(-disturbance, (setup.horizon, 1, 1))
    for place, own in zip(setup.told, columns[3:], strict=True):
        enters = np.zeros(n) if place == setup.reference else setup.entry[:, setup.known.index(place)]
        x_rest, u_rest = _rest(model, enters, 1.0 if place == setup.reference else 0.0)
        samples = seen_samples(setup, place)
        for j, sample in enumerate(_order(setup, place)):
            parameter = own[samples.index(sample)]
            x_target[j] += np.outer(x_rest, parameter)
            u_target[j] += np.outer(u_rest, parameter)
            drift[j] += np.outer(enters, parameter)
    return Prediction(model.a, model.b, q, r, p, blocks, columns[0], drift, x_target, u_target, last)


def _check_weights(q: Array, r: Array) -> None:
    """Refuse weights of which double precision cannot see both."""
    most, least = float(np.max(np.abs(q))), float(np.min(np.diag(r)))
    if most > FARTHEST * least or float(np.max(r)) > FARTHEST * most > 0:
        raise DesignError(
            f"controller.Q is up to {most:.4g} and R from {least:.4g} to {np.max(r):.4g}; beyond a ratio of "
            f"{FARTHEST:.0e} one of them counts for nothing: bring them nearer to each other"
        )


def _order(setup: MpcSetup, place: int) -> list[int]:
    """Return for each sample of the horizon which one of the input counts: u[j] meets d[j], x[j+1] the next r."""
    ahead = setup.delay + int(place == setup.reference)
    return [min(ahead + j, setup.preview) for j in range(setup.horizon)]


def _rest(model: Model, enters: Array, output: float) -> tuple[Array, Array]:
    """Return x and u at rest with the first output at `output`, while `enters` (n,) is added in every sample."""
    n, m = model.b.shape
    ring = np.block([[model.a - np.eye(n), model.b], [model.c[:1], np.zeros((1, m))]])
    wanted = np.append(-enters, output)
    found, *_ = np.linalg.lstsq(ring, wanted, rcond=None)
    if not np.allclose(ring @ found, wanted, atol=1e-6):
        raise DesignError(
            "no constant input holds the model's first output at a reference, or against a known disturbance (a zero "
            "at z = 1); remove controller.reference and controller.disturbances, or give another C"
        )
    return found[:n], found[n:]
