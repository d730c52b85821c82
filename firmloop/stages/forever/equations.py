"""Write a plant's linear equations as operations on its parameters, with their 95 % intervals."""

from __future__ import annotations

import casadi as ca

from firmloop.identify.plants.plant import Plant

_NAMES = {
    ca.OP_ADD: "add",
    ca.OP_SUB: "sub",
    ca.OP_MUL: "mul",
    ca.OP_DIV: "div",
    ca.OP_NEG: "neg",
    ca.OP_INV: "inv",
    ca.OP_SQ: "sq",
    ca.OP_TWICE: "twice",
}


class NoCertificateError(Exception):
    """A plant or a loop that no certificate can be written for; the message says why."""


def equations(plant: Plant) -> dict[str, object]:
    """Return the `plant` of a loop.json.

    Raises
    ------
    NoCertificateError
        when the plant has effects, or its equations are not linear.
    """
    if plant.effects:
        raise NoCertificateError(f"the plant has effects: {', '.join(use.name for use in plant.effects)}")
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    z = ca.vertcat(x, u)
    parts: list[ca.SX] = []
    for expression in (plant.rate(x, u, p), plant.reading(x, u, p)):
        slopes = ca.jacobian(expression, z)
        if ca.depends_on(slopes, z):
            raise NoCertificateError(f"the equations of plant {plant.kind} are not linear")
        still = ca.substitute(expression, z, ca.SX.zeros(z.shape[0]))
        parts += [slopes[:, : x.shape[0]], slopes[:, x.shape[0] :], still]
    names = [parameter.name for parameter in plant.parameters]
    operations, entries = _operations(ca.Function("entries", [p], [ca.densify(part) for part in parts]))
    written: dict[str, object] = {
        "kind": plant.kind,
        "units": [signal.unit for signal in (*plant.states, *plant.outputs)],
        "parameters": [
            {"name": one.name, "unit": one.unit, "low": repr(float(low)), "high": repr(float(high))}
            for one in plant.parameters
            for low, high in [one.interval_95 or (one.value, one.value)]
        ],
        "operations": operations,
    }
    written |= dict(zip(("a", "b", "c", "read_x", "read_u", "read_c"), entries, strict=True))
    return written | ({} if plant.delay is None else {"delay": names.index(plant.delay)})


def _operations(function: ca.Function) -> tuple[list[list[object]], list[list[list[int]]]]:
    """Return the instructions of a function as operations, and which of them its entries are."""
    operations: list[list[object]] = []
    places: dict[int, int] = {}  # of the function's work vector: operation
    entries: dict[tuple[int, int], int] = {}

    def added(*operation: object) -> int:
        operations.append(list(operation))
        return len(operations) - 1

    nothing = added("number", "0")
    for k in range(function.n_instructions()):
        code, given, made = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            entries[made[0], made[1]] = places[given[0]]
        elif code == ca.OP_INPUT:
            places[made[0]] = added("parameter", given[1])
        elif code == ca.OP_CONST:
            places[made[0]] = added("number", repr(float(function.instruction_constant(k))))
        elif code in _NAMES:
            count = 2 if code in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV) else 1
            places[made[0]] = added(_NAMES[code], *(places[at] for at in given[:count]))
        else:
            raise NoCertificateError(
                "the plant's equations take more of its parameters than sums, products and quotients"
            )
    shapes = [function.size_out(k) for k in range(function.n_out())]
    return operations, [
        [[entries.get((k, column * rows + row), nothing) for column in range(columns)] for row in range(rows)]
        for k, (rows, columns) in enumerate(shapes)
    ]
